//! A creep test from the text of a CSV file: a header line, a column of times, and one of compliance or of strain.

use crate::creep::thresholds::{LEAST_SAMPLES, LONGEST_TEST_S, SOLIDS_PER_PA};
use crate::creep::{CreepError, CreepTest};

/// Columns of times, and seconds in their unit.
const TIMES: [(&str, f64); 3] = [("time_s", 1.0), ("time_min", 60.0), ("time_h", 3600.0)];
/// Columns of compliance, and 1/Pa in their unit.
const COMPLIANCES: [(&str, f64); 3] =
    [("compliance_per_GPa", 1e-9), ("compliance_per_MPa", 1e-6), ("compliance_per_Pa", 1.0)];
/// Columns of strain, and 1 in their unit.
const STRAINS: [(&str, f64); 3] = [("strain", 1.0), ("strain_percent", 1e-2), ("strain_microstrain", 1e-6)];

/// Reads a test; `stress_pa` is the constant stress of one that gives strains. `#` begins a comment line; other columns
/// are ignored.
///
/// # Errors
/// [`CreepError::Csv`] with the line and what to do: columns that are missing or there twice, a strain without stress,
/// lines of another length, cells that are not finite numbers, times that are negative or do not increase, compliances
/// that are not positive.
pub fn read(file: &str, text: &str, stress_pa: Option<f64>) -> Result<CreepTest, CreepError> {
    let fault = |line: Option<usize>, problem: String| CreepError::Csv { file: file.to_owned(), line, problem };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = (1..).zip(text.lines()).filter(|(_, l)| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
    let Some((header_line, header)) = lines.next() else { return Err(fault(None, "the file is empty".into())) };
    let header = cells(header);
    let columns = Columns::of(&header, stress_pa).map_err(|problem| fault(Some(header_line), problem))?;
    let mut test =
        CreepTest { file: file.to_owned(), temperature_degc: None, time_s: Vec::new(), compliance_per_pa: Vec::new() };
    for (line, text) in lines {
        let fault = |problem: String| fault(Some(line), problem);
        let row = cells(text);
        if row.len() != header.len() {
            let (found, expected) = (row.len(), header.len());
            return Err(fault(format!(
                "{found} cells where the header has {expected}; decimals are written with a point"
            )));
        }
        let (time_s, compliance_per_pa) = columns.sample(&row).map_err(fault)?;
        if let Some(&before_s) = test.time_s.last()
            && time_s <= before_s
        {
            return Err(fault(format!(
                "the time {} does not come after the one before it: put the lines in order",
                &row[columns.time.0]
            )));
        }
        test.time_s.push(time_s);
        test.compliance_per_pa.push(compliance_per_pa);
    }
    if test.time_s.len() < LEAST_SAMPLES {
        let problem =
            format!("{} samples are too few for a fit: there must be {LEAST_SAMPLES} at the least", test.time_s.len());
        return Err(fault(None, problem));
    }
    Ok(test)
}

/// The cells of a line.
fn cells(line: &str) -> csv::StringRecord {
    if !line.contains('"') {
        return line.split(',').map(str::trim).collect();
    }
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).trim(csv::Trim::All).from_reader(line.trim().as_bytes());
    reader.records().next().and_then(Result::ok).unwrap_or_default()
}

/// Whether a text's header has a column of strain, which needs a stress.
pub fn has_strain(text: &str) -> bool {
    let header =
        text.trim_start_matches('\u{feff}').lines().find(|l| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
    header.is_some_and(|h| cells(h).iter().any(|c| STRAINS.iter().any(|(name, _)| *name == c)))
}

/// The columns of time and compliance, with the factors of their units.
struct Columns {
    time: (usize, f64, &'static str),
    value: (usize, f64, &'static str),
}

impl Columns {
    fn of(header: &csv::StringRecord, stress_pa: Option<f64>) -> Result<Self, String> {
        let find = |known: &'static [(&'static str, f64)]| {
            let at = |name: &str| {
                header.iter().enumerate().filter(move |(_, c)| *c == name).map(|(i, _)| i).collect::<Vec<_>>()
            };
            known
                .iter()
                .flat_map(|&(name, unit)| at(name).into_iter().map(move |i| (i, unit, name)))
                .collect::<Vec<_>>()
        };
        let names = header.iter().collect::<Vec<_>>().join(", ");
        let wanted = |known: &[(&str, f64)]| known.iter().map(|k| k.0).collect::<Vec<_>>().join(", ");
        let hint = match header.get(0) {
            Some(first) if header.len() == 1 && first.contains([';', '\t']) => {
                ": separate the columns by commas, and write decimals with a point"
            }
            Some(first) if first.parse::<f64>().is_ok() => ": the header line is missing",
            _ => "",
        };
        let one = |known: &'static [(&str, f64)], what: &str| match find(known).as_slice() {
            [one] => Ok(Some(*one)),
            [] => Ok(None),
            [a, b, ..] => Err(format!("there are two columns of {what}, {} and {}: leave one out", a.2, b.2)),
        };
        let time = one(&TIMES, "times")?
            .ok_or_else(|| format!("no column of times ({}); the columns are {names}{hint}", wanted(&TIMES)))?;
        let value = match (one(&COMPLIANCES, "compliance")?, one(&STRAINS, "strain")?) {
            (Some(a), Some(b)) => {
                return Err(format!("{} and {} are both there: leave one out", a.2, b.2));
            }
            (Some(compliance), None) => compliance,
            (None, Some((column, unit, name))) => match stress_pa {
                Some(stress_pa) => (column, unit / stress_pa, name),
                None => return Err(format!("the column {name} needs the constant stress: say option `stress_MPa` S")),
            },
            (None, None) => {
                return Err(format!(
                    "no column of compliance ({}) or strain ({}); the columns are {names}{hint}",
                    wanted(&COMPLIANCES),
                    wanted(&STRAINS)
                ));
            }
        };
        Ok(Columns { time, value })
    }

    fn sample(&self, record: &csv::StringRecord) -> Result<(f64, f64), String> {
        let number = |(column, unit, name): (usize, f64, &str)| {
            let cell = &record[column];
            let finite = cell.parse::<f64>().ok().filter(|v| v.is_finite());
            finite.map(|v| v * unit).ok_or_else(|| format!("column '{name}': '{cell}' is not a finite number"))
        };
        let (time_s, value) = (number(self.time)?, number(self.value)?);
        if time_s < 0.0 {
            return Err(format!(
                "column '{}': {} lies before the load: count time from the moment it acts",
                self.time.2, &record[self.time.0]
            ));
        }
        if value <= 0.0 {
            return Err(format!(
                "column '{}': {} is not positive: leave out what was read before the load acted, and give compression a plus sign",
                self.value.2, &record[self.value.0]
            ));
        }
        if !(SOLIDS_PER_PA.0..=SOLIDS_PER_PA.1).contains(&value) {
            return Err(format!(
                "column '{}': {} gives {value:.1e} 1/Pa, which no solid has: check the column's unit and the stress",
                self.value.2, &record[self.value.0]
            ));
        }
        if time_s > LONGEST_TEST_S {
            return Err(format!("column '{}': {} is more than a thousand years", self.time.2, &record[self.time.0]));
        }
        Ok((time_s, value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &str = "1,1\n2,2\n3,3\n4,4\n5,5\n";

    #[test]
    fn units_are_those_of_the_header() {
        let first = |header: &str, stress_pa: Option<f64>| {
            let small = BODY.replace(',', "e-6,").replace('\n', "e-6\n");
            let body = if header.ends_with("per_Pa") { &small } else { BODY };
            let test = read("a.csv", &format!("# made by hand\n{header}\n# so\n{body}"), stress_pa).unwrap();
            (test.time_s[1], test.compliance_per_pa[1])
        };
        let close = |a: (f64, f64), b: (f64, f64)| (a.0 / b.0 - 1.0).abs() < 1e-12 && (a.1 / b.1 - 1.0).abs() < 1e-12;
        assert!(close(first("time_s,compliance_per_GPa", None), (2.0, 2e-9)));
        assert!(close(first("\"time_min\", compliance_per_MPa", Some(1.0)), (120.0, 2e-6)));
        assert!(close(first("time_h,compliance_per_Pa", None), (2e-6 * 3600.0, 2e-6)));
        assert!(close(first("time_s,strain", Some(4e6)), (2.0, 5e-7)));
        assert!(close(first("strain_percent,time_s", Some(1e6)), (2.0, 2e-8)));
        assert!(close(first("time_s,strain_microstrain", Some(1e6)), (2.0, 2e-12)));
        assert!(has_strain("# c\n\"strain_percent\",time_s\n") && !has_strain("time_s,compliance_per_Pa\nstrain,1\n"));
    }

    #[test]
    fn every_fault_is_told_with_its_line_and_what_to_do() {
        let head = "time_s,compliance_per_GPa\n";
        let cases = [
            (String::new(), None, "the file is empty"),
            ("# only\n".to_owned(), None, "the file is empty"),
            (
                format!("t,compliance_per_GPa\n{BODY}"),
                Some(1),
                "no column of times (time_s, time_min, time_h); the columns are t, compliance_per_GPa",
            ),
            (format!("time_s;compliance_per_GPa\n{BODY}"), Some(1), "separate the columns by commas"),
            (BODY.to_owned(), Some(1), "the header line is missing"),
            (format!("time_s,J\n{BODY}"), Some(1), "no column of compliance (compliance_per_GPa"),
            (format!("time_s,time_s\n{BODY}"), Some(1), "two columns of times, time_s and time_s"),
            (format!("time_s,strain\n{BODY}"), Some(1), "say option `stress_MPa`"),
            (
                "time_s,strain,compliance_per_Pa\n1,1,1\n".to_owned(),
                Some(1),
                "compliance_per_Pa and strain are both there",
            ),
            (format!("# c\n{head}1,1\n\n2,x\n"), Some(5), "column 'compliance_per_GPa': 'x' is not a finite number"),
            (format!("{head}1,inf\n"), Some(2), "'inf' is not a finite"),
            (format!("{head}1,\n"), Some(2), "'' is not a finite"),
            (format!("{head}1,2\n2,1,5\n"), Some(3), "3 cells where the header has 2"),
            (format!("{head}2,1\n2,1\n"), Some(3), "the time 2 does not come after"),
            (format!("{head}-1,1\n"), Some(2), "lies before the load"),
            (format!("{head}0,0\n"), Some(2), "is not positive"),
            (format!("{head}1,1e200\n"), Some(2), "which no solid has: check the column's unit and the stress"),
            (format!("{head}1e300,1\n"), Some(2), "more than a thousand years"),
            (format!("{head}1,1\n2,2\n"), None, "2 samples are too few"),
            (head.to_owned(), None, "0 samples are too few"),
        ];
        for (text, line, message) in cases {
            let CreepError::Csv { line: at, problem, .. } = read("a.csv", &text, None).unwrap_err() else {
                panic!("{text:?}")
            };
            assert!(problem.contains(message), "{text:?}: {problem}");
            assert_eq!(at, line, "{text:?}: {problem}");
        }
    }
}
