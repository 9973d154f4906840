//! Scales that NI's programs keep in properties: raw values become those of the channel's unit.

use crate::storage::import::tdms::property::{Properties, Property};

/// The scales of a channel, each fed by the raw values or by another one; the last one counts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scaling {
    scales: Vec<(Scale, Option<usize>)>,
}

#[derive(Debug, Clone, PartialEq)]
enum Scale {
    /// Coefficients from the constant term up; a linear scale has two.
    Polynomial(Vec<f64>),
    Add(usize),
    /// This one less the input.
    Subtract(usize),
}

/// Input of a scale that is the raw data.
const RAW: f64 = u32::MAX as f64;
/// NI's programs chain a few; more are damage.
const MOST: f64 = 100.0;

/// The scaling that an object's properties describe; `None` where there is none or the values are scaled already.
pub(crate) fn scaling(properties: &Properties) -> Result<Option<Scaling>, String> {
    let number = |key: String| match properties.get(&key) {
        Some(Property::Number(n)) => Some(*n),
        _ => None,
    };
    let text = |key: &str| match properties.get(key) {
        Some(Property::Text(text)) => Some(text.as_str()),
        _ => None,
    };
    let count = number("NI_Number_Of_Scales".into()).unwrap_or(0.0);
    if count < 1.0 || text("NI_Scaling_Status") == Some("scaled") {
        return Ok(None);
    }
    if count > MOST {
        return Err(format!("{count} scales one after the other: the file is damaged"));
    }
    let mut scales = Vec::new();
    for i in 0..count as usize {
        let kind = text(&format!("NI_Scale[{i}]_Scale_Type")).ok_or_else(|| format!("scale {i} has no type"))?;
        let of = |key: &str| number(format!("NI_Scale[{i}]_{key}"));
        let need = |key: &str| of(key).ok_or_else(|| format!("scale {i} ({kind}) lacks {key}"));
        let input = |key: &str| match of(key).unwrap_or(RAW) {
            RAW => Ok(None),
            place if place >= 0.0 && place < i as f64 => Ok(Some(place as usize)),
            place => Err(format!("scale {i} takes its input from scale {place}, which does not come before it")),
        };
        let other = |key: &str| input(key)?.ok_or_else(|| format!("scale {i} ({kind}) of raw data is not known here"));
        scales.push(match kind {
            "Linear" => {
                let line = vec![need("Linear_Y_Intercept")?, need("Linear_Slope")?];
                (Scale::Polynomial(line), input("Linear_Input_Source")?)
            }
            "Polynomial" => {
                let size = of("Polynomial_Coefficients_Size").unwrap_or(4.0).clamp(0.0, MOST) as usize;
                let terms =
                    (0..size).map(|k| need(&format!("Polynomial_Coefficients[{k}]"))).collect::<Result<_, _>>()?;
                (Scale::Polynomial(terms), input("Polynomial_Input_Source")?)
            }
            "Add" => (Scale::Add(other("Add_Left_Operand_Input_Source")?), input("Add_Right_Operand_Input_Source")?),
            "Subtract" => {
                let right = other("Subtract_Right_Operand_Input_Source")?;
                (Scale::Subtract(right), input("Subtract_Left_Operand_Input_Source")?)
            }
            "AdvancedAPI" => (Scale::Polynomial(vec![0.0, 1.0]), input("AdvancedAPI_Input_Source")?),
            other => {
                return Err(format!("its scale '{other}' is not known here: save scaled values, or export it as CSV"));
            }
        });
    }
    Ok(Some(Scaling { scales }))
}

impl Scaling {
    pub(crate) fn apply(&self, raw: &[f64]) -> Vec<f64> {
        let mut results = vec![0.0; self.scales.len()];
        let one = |&value: &f64| {
            for (i, (scale, input)) in self.scales.iter().enumerate() {
                let x = input.map_or(value, |k| results[k]);
                results[i] = match scale {
                    Scale::Polynomial(terms) => terms.iter().rev().fold(0.0, |sum, c| sum * x + c),
                    Scale::Add(other) => results[*other] + x,
                    Scale::Subtract(other) => results[*other] - x,
                };
            }
            results.last().copied().unwrap_or(value)
        };
        raw.iter().map(one).collect()
    }
}
