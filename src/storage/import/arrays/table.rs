//! Arrays and the times that belong to them become tables in text.

use std::collections::BTreeMap;

use crate::storage::import::arrays::contents::{Array, Contents};
use crate::storage::import::arrays::times::{
    self, Belongs, Step, is_time, label_of, parent, rises, short, step_of, time_of, unit_of,
};
use crate::storage::import::csv::heading::key_of;
use crate::storage::import::csv::scaled::{changes, factor_in_words, property_is_absolute};
use crate::storage::import::source::Repair;
use crate::storage::import::tables::Tables;

/// Arrays that have their times in common.
struct Table<'c> {
    time: Option<&'c Array>,
    step: Option<Step>,
    arrays: Vec<&'c Array>,
}

/// A table for each array of times with the arrays that belong to it, for each matrix whose first column rises, and for
/// each stated step. Where there is none, the arrays of that length which most have are one, and its times are found as
/// in any other table.
///
/// # Errors
/// No array is a series.
pub(crate) fn tables_of_arrays(contents: Contents) -> Result<Tables, String> {
    let contents = headed(contents);
    let Contents { arrays, texts, unread } = &contents;
    let (mut repairs, mut left_out) = (Vec::new(), unread.clone());
    let series: Vec<&Array> = arrays.iter().filter(|a| a.samples() > 1).collect();
    let times: Vec<usize> = (0..series.len()).filter(|&i| is_time(series[i])).collect();
    let mut tables: Vec<Table> =
        times.iter().map(|&i| Table { time: Some(series[i]), step: None, arrays: Vec::new() }).collect();
    let mut alone = Vec::new();
    for at in (0..series.len()).filter(|at| !times.contains(at)) {
        let array = series[at];
        match time_of(at, &times, &series) {
            Some((time, belongs)) => {
                if belongs == Belongs::Perhaps {
                    let text = format!("the times of '{}' are '{}'", array.name, series[time].name);
                    repairs.push(Repair::guess("times-of", text));
                }
                let place = times.iter().position(|&i| i == time).unwrap_or_default();
                tables[place].arrays.push(array);
            }
            None if array.columns.len() > 1 && rises(&array.columns[0]) => {
                tables.push(Table { time: None, step: None, arrays: vec![array] });
            }
            None => alone.push(array),
        }
    }
    let mut unused: Vec<&Array> = tables.iter().filter(|t| t.arrays.is_empty()).filter_map(|t| t.time).collect();
    tables.retain(|table| !table.arrays.is_empty());
    // What has no times has a stated step of its own, or one that stands for all.
    let is_timed = !tables.is_empty();
    let mut rest = Vec::new();
    for array in alone {
        match step_of(array, &contents).filter(|step| step.is_own || !is_timed) {
            Some(step) => {
                let alike = |t: &&mut Table| {
                    t.step.as_ref().is_some_and(|s| s.seconds == step.seconds)
                        && t.arrays[0].samples() == array.samples()
                };
                match tables.iter_mut().find(alike) {
                    Some(table) => table.arrays.push(array),
                    None => tables.push(Table { time: None, step: Some(step), arrays: vec![array] }),
                }
            }
            None => rest.push(array),
        }
    }
    if tables.is_empty() {
        rest.append(&mut unused);
        let mut lengths: BTreeMap<usize, usize> = BTreeMap::new();
        rest.iter().for_each(|array| *lengths.entry(array.samples()).or_default() += array.columns.len());
        let most = lengths.iter().max_by_key(|(samples, count)| (**count, **samples)).map(|(samples, _)| *samples);
        let most = most.ok_or("it holds no array of numbers with more than one value")?;
        let (arrays, others) = series.iter().partition(|array| array.samples() == most);
        tables.push(Table { time: None, step: None, arrays });
        rest = others;
    }
    // a stated step holds for what is as long as the series of the test
    let longest = |t: &Table| t.arrays[0].samples() * t.arrays.iter().map(|a| a.columns.len()).sum::<usize>();
    if !is_timed && let Some(most) = tables.iter().map(longest).max() {
        let is_small = |t: &Table| t.step.as_ref().is_some_and(|step| !step.is_own) && longest(t) < most;
        let (small, large): (Vec<_>, Vec<_>) = tables.into_iter().partition(is_small);
        rest.extend(small.iter().flat_map(|table| &table.arrays));
        tables = large;
    }
    left_out.extend(rest.iter().map(|a| (a.name.clone(), format!("{}, without times", a.sizes()))));
    left_out.extend(unused.iter().map(|a| (a.name.clone(), format!("{}, times of nothing", a.sizes()))));
    for table in &tables {
        let names: Vec<String> = table.arrays.iter().map(|a| format!("'{}'", a.name)).collect();
        if let Some(step) = &table.step {
            let text = format!("{} has a sample every {} s, by '{}'", names.join(", "), step.seconds, step.name);
            repairs.push(Repair::new("step", 1, None, text));
        }
    }
    let columns: Vec<&Array> = tables.iter().flat_map(|t| t.arrays.iter().copied()).collect();
    let stated = stated(arrays, texts);
    let texts = tables.iter().map(|t| (t.arrays[0].name.clone(), stated.clone() + &t.text(&columns, texts))).collect();
    Ok(Tables { texts, repairs, left_out, paths: true })
}

/// Names and units of arrays that stand in a structure of their own: `Channel_2_Header` beside `Channel_2_Data`.
fn headed(mut contents: Contents) -> Contents {
    let said = |array: &Array, field: &str| {
        let place = format!("{}_Header/{field}", array.name.strip_suffix("_Data")?);
        contents.texts.iter().find(|(name, _)| *name == place).map(|(_, text)| text.trim().replace('/', " "))
    };
    let found: Vec<_> = contents.arrays.iter().map(|a| (said(a, "SignalName"), said(a, "Unit"))).collect();
    for (at, (name, unit)) in found.iter().enumerate() {
        let is_own = name.is_some() && found.iter().filter(|(other, _)| other == name).count() == 1;
        if let Some(name) = name.as_ref().filter(|_| is_own) {
            contents.arrays[at].name = name.clone();
        }
        contents.texts.extend(unit.as_ref().map(|unit| (format!("{}/unit", contents.arrays[at].name), unit.clone())));
    }
    contents
}

/// Attributes that change the numbers or say where they count from, as remarks above the table.
fn stated(arrays: &[Array], texts: &[(String, String)]) -> String {
    let numbers = arrays.iter().filter(|a| a.samples() == 1).map(|a| (&a.name, a.columns[0][0].to_string()));
    let all = numbers.chain(texts.iter().map(|(name, text)| (name, text.clone())));
    let says = |(name, text): &(&String, String)| {
        let name = short(name);
        changes(&key_of(name), text) || property_is_absolute(name, text) || factor_in_words(text).is_some()
    };
    let line = |(name, text): (&String, String)| {
        let plain = |text: &str| text.replace(char::is_control, " ");
        format!("# {}: {}\n", plain(short(name)), plain(&text))
    };
    all.filter(says).map(line).collect()
}

impl Table<'_> {
    /// Its times first, then each column of each array.
    fn text(&self, all: &[&Array], texts: &[(String, String)]) -> String {
        let series = |array: &&Array| !is_time(array);
        let lone = |array: &Array| {
            all.iter().copied().filter(series).filter(|a| parent(&a.name) == parent(&array.name)).count() < 2
        };
        let with_unit = |name: String, unit: Option<&str>| match unit {
            Some(unit) => format!("{name} ({unit})"),
            None => name,
        };
        let mut headings = Vec::new();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        if let Some(time) = self.time {
            headings.push(times::heading(time, texts));
            columns.push(time.columns[0].clone());
        } else if let Some(step) = &self.step {
            headings.push("time (s)".to_owned());
            columns.push((0..self.arrays[0].samples()).map(|i| i as f64 * step.seconds).collect());
        }
        for array in &self.arrays {
            let is_twice = all.iter().filter(|other| short(&other.name) == short(&array.name)).count() > 1;
            let is_alone = lone(array);
            let label = label_of(array, texts).filter(|_| is_alone);
            let name = label.unwrap_or(if is_twice { array.name.as_str() } else { short(&array.name) });
            let unit = unit_of(array, is_alone, texts);
            for (place, column) in array.columns.iter().enumerate() {
                let number = if array.columns.len() > 1 { format!(" {}", place + 1) } else { String::new() };
                headings.push(with_unit(format!("{name}{number}"), unit));
                columns.push(column.clone());
            }
        }
        // A table's lines and cells end where they end here.
        let plain = |heading: &String| heading.replace(|c: char| c.is_control() || c == '"', " ");
        let mut text = headings.iter().map(plain).collect::<Vec<_>>().join("\t") + "\n";
        for row in 0..self.arrays[0].samples() {
            let cell =
                |column: &Vec<f64>| if column[row].is_finite() { column[row].to_string() } else { String::new() };
            text += &columns.iter().map(cell).collect::<Vec<_>>().join("\t");
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(name: &str, size: [usize; 2], values: &[f64]) -> Array {
        Array::new(name.into(), size, values)
    }

    fn tables(arrays: Vec<Array>, texts: &[(&str, &str)]) -> Tables {
        let texts = texts.iter().map(|(name, text)| (name.to_string(), text.to_string())).collect();
        tables_of_arrays(Contents { arrays, texts, unread: Vec::new() }).unwrap()
    }

    fn texts(found: &Tables) -> Vec<&str> {
        found.texts.iter().map(|(_, text)| text.as_str()).collect()
    }

    #[test]
    fn arrays_are_a_table_however_they_lie() {
        let arrays = vec![
            array("fs", [1, 1], &[500.0]),
            array("run/t", [3, 1], &[0.0, 0.5, 1.0]),
            array("run/p", [1, 3], &[1.0, f64::NAN, 3.0]),
            array("run/q", [3, 2], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            array("long", [4, 1], &[0.0; 4]),
        ];
        let found = tables(arrays, &[("run/p/units", "bar")]);
        assert_eq!(texts(&found), ["t\tp (bar)\tq 1\tq 2\n0\t1\t1\t4\n0.5\t\t2\t5\n1\t3\t3\t6\n"]);
        assert_eq!(found.left_out, [("long".to_owned(), "4 × 1, without times".to_owned())]);
        assert!(tables_of_arrays(Contents::default()).is_err());
    }

    /// MATLAB saves its variables in the order of the alphabet.
    #[test]
    fn each_array_goes_by_its_own_times() {
        let (slow, fast, p) = ([0.0, 1.0, 2.0], [0.0, 0.1, 0.2], [5.0, 6.0, 7.0]);
        let named = |names: [&str; 4]| {
            let values = [&p, &p, &slow, &fast];
            names.iter().zip(values).map(|(name, values)| array(name, [3, 1], values)).collect::<Vec<_>>()
        };
        let pairs = [
            ["P1", "P2", "t1", "t2"],
            ["P1", "P2", "time_P1", "time_P2"],
            ["P1", "P2", "tP1", "tP2"],
            ["P1", "P2", "P1_time", "P2_time"],
            ["a/P1", "b/P2", "a/time", "b/time"],
        ];
        for names in pairs {
            let found = tables(named(names), &[]);
            let [first, second] = texts(&found)[..] else { panic!("{names:?}: {found:?}") };
            assert!(
                first.contains("P1\n0\t5\n1\t6\n") && second.contains("P2\n0\t5\n0.1\t6\n"),
                "{names:?}: {found:?}"
            );
            assert_eq!(found.repairs, [], "{names:?}");
        }
        // by their order alone, it is a guess
        let mut arrays = named(["upper", "lower", "t1", "t2"]);
        arrays.swap(0, 2);
        arrays.swap(1, 2);
        arrays.swap(2, 3);
        assert_eq!(arrays.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["t1", "upper", "t2", "lower"]);
        let found = tables(arrays, &[]);
        assert!(
            texts(&found)[0].contains("upper\n0\t5\n1\t6") && texts(&found)[1].contains("lower\n0\t5\n0.1\t6"),
            "{found:?}"
        );
        assert!(found.repairs.iter().all(|r| r.guessed) && found.repairs.len() == 2, "{found:?}");
        // a copy of the same times is no choice
        let same = vec![array("t", [3, 1], &slow), array("t2", [3, 1], &slow), array("p", [3, 1], &p)];
        assert_eq!(tables(same, &[]).repairs, []);
    }

    #[test]
    fn a_stated_step_or_rate_gives_the_times() {
        let scope = vec![
            array("A", [3, 1], &[1.0, 2.0, 3.0]),
            array("B", [3, 1], &[4.0, 5.0, 6.0]),
            array("Tinterval", [1, 1], &[0.002]),
            array("Version", [2, 1], &[1.0, 1.0]),
        ];
        let found = tables(scope, &[]);
        assert_eq!(texts(&found), ["time (s)\tA\tB\n0\t1\t4\n0.002\t2\t5\n0.004\t3\t6\n"]);
        assert_eq!((found.repairs[0].what, found.left_out.len()), ("step", 1));
        let own = vec![
            array("P1", [2, 1], &[1.0, 2.0]),
            array("P1/sampling_rate", [1, 1], &[2.0]),
            array("T1", [2, 1], &[20.0, 21.0]),
            array("T1/sampling_rate", [1, 1], &[0.5]),
            array("T1/sampling_rate_unit", [1, 1], &[0.5]),
        ];
        let found = tables(own, &[("P1/unit", "bar")]);
        assert_eq!(texts(&found), ["time (s)\tP1 (bar)\n0\t1\n0.5\t2\n", "time (s)\tT1\n0\t20\n2\t21\n"]);
    }

    /// As catman writes it.
    #[test]
    fn a_structure_beside_an_array_heads_it() {
        let arrays = vec![array("Channel_1_Data", [2, 1], &[0.0, 0.5]), array("Channel_2_Data", [2, 1], &[5.0, 6.0])];
        let texts_of = [
            ("Channel_1_Header/SignalName", "Time  1 - default sample rate"),
            ("Channel_1_Header/Unit", "s"),
            ("Channel_2_Header/SignalName", "Valve"),
            ("Channel_2_Header/Unit", "kPa"),
        ];
        assert_eq!(texts(&tables(arrays, &texts_of)), ["time (s)\tValve (kPa)\n0\t5\n0.5\t6\n"]);
    }

    #[test]
    fn units_stand_beside_or_within() {
        let (t, p) = ([0.0, 1.0, 2.0], [5.0, 6.0, 7.0]);
        for (name, text) in
            [("P1", "P1_unit"), ("P1", "units/P1"), ("P1/data", "P1/unit"), ("P1/data", "P1/data/Units")]
        {
            let time = if name.contains('/') { "P1/time" } else { "t" };
            let found = tables(vec![array(time, [3, 1], &t), array(name, [3, 1], &p)], &[(text, "psi")]);
            assert!(texts(&found)[0].starts_with(&format!("{}\tP1 (psi)\n", short(time))), "{text}: {found:?}");
        }
        let named = tables(
            vec![array("ch(1)/x", [3, 1], &p), array("ch(1)/t", [3, 1], &t)],
            &[("ch(1)/name", "P1"), ("ch(1)/unit", "bar")],
        );
        assert!(texts(&named)[0].starts_with("t\tP1 (bar)\n"), "{named:?}");
        // one unit beside several arrays is nobody's
        let both = vec![array("t", [3, 1], &t), array("P1", [3, 1], &p), array("T1", [3, 1], &p)];
        assert!(texts(&tables(both, &[("unit", "psi")]))[0].starts_with("t\tP1\tT1\n"));
    }
}
