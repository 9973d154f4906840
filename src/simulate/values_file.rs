//! A file of values: `NAME = VALUE` a line, those of one recording below its name in brackets, `#` before a comment.
//!
//! Programs that search for values (PEST and its kin) write it from a template.

use std::path::Path;

use crate::model::constraint::Given;
use crate::model::effects::pipe_is_no_setting;
use crate::shown::Shown as _;
use crate::text_file::read_text;

/// Reads it.
///
/// # Errors
/// A file that cannot be read, a line that is no value, a value given twice.
pub fn read(path: &Path) -> Result<Vec<Given>, String> {
    let name = path.shown();
    let text = read_text(path).map_err(|e| format!("cannot read the values in {name}: {e}"))?;
    parse(&text).map_err(|e| format!("{name}, {e}"))
}

fn parse(text: &str) -> Result<Vec<Given>, String> {
    let mut run: Option<String> = None;
    let mut given: Vec<Given> = Vec::new();
    for (i, line) in text.lines().enumerate().map(|(i, l)| (i, l.trim())) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        if let Some(file) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            run = Some(file.trim().to_owned());
            continue;
        }
        let (name, value) = value(line).map_err(|e| format!("line {}: {e}", i + 1))?;
        if given.iter().any(|g| g.name == name && g.run == run) {
            return Err(format!("line {}: {name} has a value already", i + 1));
        }
        given.push(Given { name, run: run.clone(), value });
    }
    Ok(given)
}

/// `NAME = VALUE`.
fn value(line: &str) -> Result<(String, f64), String> {
    let (name, text) = line.split_once('=').map(|(name, text)| (name.trim(), text.trim())).unwrap_or_default();
    if name.is_empty() {
        return Err("write it as NAME=VALUE".to_owned());
    }
    if let Some(why) = pipe_is_no_setting(name) {
        return Err(why);
    }
    // Fortran programs may write an exponent with D.
    let number = text.replace(['D', 'd'], "E").parse().ok().filter(|v: &f64| v.is_finite());
    Ok((name.to_owned(), number.ok_or_else(|| format!("'{text}' is not a number"))?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_programs_write_is_read_and_slips_are_explained() {
        let text = "# values\nwave_speed_m_s =   3.95000E+02\n tau1_s=.5\n\n[run 1.mcap]\noffset_m[P1] = -1.D-02\n[b]\noffset_m[P1] = 2.\n";
        let of =
            |name: &str, run: Option<&str>, value: f64| Given { name: name.into(), run: run.map(Into::into), value };
        let wanted = [
            of("wave_speed_m_s", None, 395.0),
            of("tau1_s", None, 0.5),
            of("offset_m[P1]", Some("run 1.mcap"), -0.01),
            of("offset_m[P1]", Some("b"), 2.0),
        ];
        assert_eq!(parse(text).unwrap(), wanted);
        for (text, said) in [
            ("a = 1\nb 2", "line 2: write it as NAME=VALUE"),
            ("a = ~a~", "line 1: '~a~' is not a number"),
            (
                "leak_pipe = branch",
                "line 1: the pipe stands behind the effect's name: write leak@PIPE in option `effects`, PIPE being the name of the pipe",
            ),
            ("a = 1\n#\na = 2", "line 3: a has a value already"),
        ] {
            assert_eq!(parse(text).unwrap_err(), said);
        }
    }
}
