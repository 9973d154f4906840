//! Files of named arrays, as MATLAB, Octave, SciPy and h5py write them: vectors of one length become the columns of a table.

pub(crate) mod hdf5;
pub(crate) mod mat;

use std::collections::BTreeMap;

/// What a file may unpack to, as a multiple of its size.
const MOST_UNPACKED: usize = 100;
/// Variables, groups or fields of a file beyond which it is none of a test.
const MOST_ARRAYS: usize = 10_000;
/// Groups or structures within each other.
const DEEPEST: usize = 16;

/// A named array of numbers.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Array {
    /// Its name, with those of the groups around it, separated by `/`.
    pub(crate) name: String,
    /// Its unit, where the file says so.
    pub(crate) unit: Option<String>,
    /// Its columns, each of the longer of its two dimensions.
    pub(crate) columns: Vec<Vec<f64>>,
}

impl Array {
    /// An array of two dimensions whose first index runs fastest.
    fn new(name: String, unit: Option<String>, [rows, columns]: [usize; 2], values: &[f64]) -> Array {
        let at = |row: usize, column: usize| values.get(row + column * rows).copied().unwrap_or(f64::NAN);
        let columns = if rows >= columns {
            (0..columns).map(|c| (0..rows).map(|r| at(r, c)).collect()).collect()
        } else {
            (0..rows).map(|r| (0..columns).map(|c| at(r, c)).collect()).collect()
        };
        Array { name, unit, columns }
    }

    fn samples(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }
}

/// The arrays of that length which most have, as a table in text; times and units are then found as in any other table.
///
/// # Errors
/// No array is a series.
pub(crate) fn text_of_arrays(arrays: &[Array]) -> Result<String, String> {
    let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
    for array in arrays.iter().filter(|a| a.samples() > 1) {
        *lengths.entry(array.samples()).or_default() += array.columns.len();
    }
    let samples = lengths.iter().max_by_key(|(samples, count)| (**count, **samples)).map(|(samples, _)| *samples);
    let samples = samples.ok_or("it holds no array of numbers with more than one value")?;
    let series: Vec<&Array> = arrays.iter().filter(|a| a.samples() == samples).collect();
    let short = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
    let heading = |array: &Array, place: usize| {
        let twice = series.iter().filter(|other| short(&other.name) == short(&array.name)).count() > 1;
        let name = if twice { array.name.clone() } else { short(&array.name) };
        let number = if array.columns.len() > 1 { format!(" {}", place + 1) } else { String::new() };
        let unit = array.unit.as_ref().map_or(String::new(), |unit| format!(" ({unit})"));
        // A table's lines and cells end where they end here.
        format!("{name}{number}{unit}").replace(|c: char| c.is_control() || c == '"', " ")
    };
    let headings: Vec<String> =
        series.iter().flat_map(|a| (0..a.columns.len()).map(|place| heading(a, place))).collect();
    let columns: Vec<&Vec<f64>> = series.iter().flat_map(|a| &a.columns).collect();
    let mut text = headings.join("\t") + "\n";
    for row in 0..samples {
        let cell = |column: &&Vec<f64>| if column[row].is_finite() { column[row].to_string() } else { String::new() };
        text += &columns.iter().map(cell).collect::<Vec<_>>().join("\t");
        text.push('\n');
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_of_one_length_are_a_table_however_they_lie() {
        let array = |name: &str, size, values: &[f64]| Array::new(name.into(), None, size, values);
        let arrays = [
            array("fs", [1, 1], &[500.0]),
            array("run/t", [3, 1], &[0.0, 0.5, 1.0]),
            Array { unit: Some("bar".into()), ..array("run/p", [1, 3], &[1.0, f64::NAN, 3.0]) },
            array("q", [3, 2], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            array("other/t", [3, 1], &[7.0, 8.0, 9.0]),
            array("long", [4, 1], &[0.0; 4]),
        ];
        let table = "run/t\tp (bar)\tq 1\tq 2\tother/t\n0\t1\t1\t4\t7\n0.5\t\t2\t5\t8\n1\t3\t3\t6\t9\n";
        assert_eq!(text_of_arrays(&arrays).unwrap(), table);
        assert!(text_of_arrays(&arrays[..1]).is_err());
    }
}
