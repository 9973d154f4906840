//! Tables in JSON: records, one object a line, columns, or rows under their names. What stands beside them goes above the table as a remark.

use serde_json::{Deserializer, Map, Value};

use crate::storage::import::tables::Tables;

/// Objects within each other.
const DEEPEST: usize = 4;

/// Whether a text is a list or an object in JSON, by how it begins.
pub(crate) fn is_json(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let after = |mark: u8| text.strip_prefix(&[mark]).map(<[u8]>::trim_ascii_start);
    after(b'{').is_some_and(|rest| rest.starts_with(b"\""))
        || after(b'[').is_some_and(|rest| rest.starts_with(b"{") || rest.starts_with(b"["))
}

/// The table of a text in JSON.
///
/// # Errors
/// It is damaged, or of another form.
pub(crate) fn tables_of_json(bytes: &[u8]) -> Result<Tables, String> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let values = Deserializer::from_slice(text).into_iter::<Value>().collect::<Result<Vec<_>, _>>();
    let mut values = values.map_err(|fault| format!("this is no whole JSON ({fault}): save it anew, or as CSV"))?;
    let whole = if values.len() == 1 { values.remove(0) } else { Value::Array(values) };
    let mut found = Found::default();
    found.take(&whole, "", 0);
    let Found { columns, remarks } = found;
    let rows = columns.iter().map(|(_, cells)| cells.len()).max().unwrap_or(0);
    if rows < 2 {
        return Err(
            "this JSON is no table of records or of columns: save it as CSV in the program that wrote it".into()
        );
    }
    let (columns, others): (Vec<_>, Vec<_>) = columns.into_iter().partition(|(_, cells)| cells.len() == rows);
    let left_out =
        others.into_iter().map(|(name, cells)| (name, format!("{} values where others have {rows}", cells.len())));
    let line = |cells: Vec<&str>| cells.join("\t") + "\n";
    let mut text: String = remarks.iter().map(|(name, value)| format!("# {name}: {value}\n")).collect();
    text += &line(columns.iter().map(|(name, _)| name.as_str()).collect());
    (0..rows).for_each(|row| text += &line(columns.iter().map(|(_, cells)| cells[row].as_str()).collect()));
    Ok(Tables { texts: vec![("table".to_owned(), text)], left_out: left_out.collect(), ..Tables::default() })
}

/// Columns by their names, in the file's order, and what stands beside them.
#[derive(Default)]
struct Found {
    columns: Vec<(String, Vec<String>)>,
    remarks: Vec<(String, String)>,
}

impl Found {
    fn take(&mut self, value: &Value, name: &str, depth: usize) {
        match value {
            Value::Array(items) if items.iter().all(Value::is_object) && !items.is_empty() => self.records(items),
            Value::Array(items) if items.iter().all(Value::is_array) && !items.is_empty() => self.rows(items),
            Value::Array(items) if items.iter().all(|item| cell(item).is_some()) => {
                self.columns.push((plain(name), items.iter().filter_map(cell).collect()));
            }
            Value::Object(map)
                if map.get("columns").zip(map.get("data")).is_some_and(|(c, d)| c.is_array() && d.is_array()) =>
            {
                self.split(map)
            }
            Value::Object(map) if depth > 0 && by_index(map) => self.indexed(map, name),
            Value::Object(map) if depth < DEEPEST => {
                map.iter().for_each(|(name, value)| self.take(value, name, depth + 1));
            }
            other => self.remarks.extend(cell(other).map(|value| (plain(name), value))),
        }
    }

    /// `[{"t": 0, "P1": 5.9}, …]`; what a record lacks is an empty cell.
    fn records(&mut self, items: &[Value]) {
        let from = self.columns.len();
        for (row, item) in items.iter().enumerate() {
            let mut cells = Vec::new();
            flat(item, "", 0, &mut cells);
            for (name, cell) in cells {
                let at = self.columns[from..].iter().position(|(other, _)| *other == name).map(|at| from + at);
                let at = at.unwrap_or_else(|| {
                    self.columns.push((name, Vec::new()));
                    self.columns.len() - 1
                });
                let column = &mut self.columns[at].1;
                column.resize(row, String::new());
                column.push(cell);
            }
        }
        self.columns[from..].iter_mut().for_each(|(_, column)| column.resize(items.len(), String::new()));
    }

    /// `[["t", "P1"], [0, 5.9], …]`.
    fn rows(&mut self, items: &[Value]) {
        let cells = |row: &Value| {
            row.as_array().map(|row| row.iter().map(|item| cell(item).unwrap_or_default()).collect::<Vec<_>>())
        };
        let mut rows: Vec<Vec<String>> = items.iter().filter_map(cells).collect();
        let is_named = items[0].as_array().is_some_and(|first| first.iter().all(Value::is_string));
        let names = if is_named { rows.remove(0) } else { Vec::new() };
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        for at in 0..width {
            let column = rows.iter().map(|row| row.get(at).cloned().unwrap_or_default()).collect();
            self.columns.push((names.get(at).cloned().unwrap_or_else(|| (at + 1).to_string()), column));
        }
    }

    /// `{"columns": ["t", "P1"], "data": [[0, 5.9], …], "index": […]}`, as pandas splits a table.
    fn split(&mut self, map: &Map<String, Value>) {
        let rows = [&map["columns"]].into_iter().chain(map["data"].as_array().into_iter().flatten()).cloned();
        if let Some(index) = map.get("index") {
            self.take(index, "index", 1);
        }
        self.rows(&rows.collect::<Vec<_>>());
    }

    /// `"P1": {"0": 5.9, "1": 5.8}`: each value under its place or its time.
    fn indexed(&mut self, map: &Map<String, Value>, name: &str) {
        let mut keyed: Vec<(&String, String)> =
            map.iter().filter_map(|(key, value)| Some((key, cell(value)?))).collect();
        keyed.sort_by(|(a, _), (b, _)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => a.total_cmp(&b),
            _ => a.cmp(b),
        });
        let counts = keyed.iter().enumerate().all(|(place, (key, _))| **key == place.to_string());
        if !counts && !self.columns.iter().any(|(other, _)| other == "index") {
            self.columns.push(("index".to_owned(), keyed.iter().map(|(key, _)| plain(key)).collect()));
        }
        self.columns.push((plain(name), keyed.into_iter().map(|(_, cell)| cell).collect()));
    }
}

/// Whether an object holds the values of a column, each under its place or its time.
fn by_index(map: &Map<String, Value>) -> bool {
    let digits = map.keys().filter(|key| key.starts_with(|c: char| c.is_ascii_digit())).count();
    map.len() > 1 && digits == map.len() && map.values().all(|value| cell(value).is_some())
}

/// The cells of a record, by their names; of what stands within it by both.
fn flat(value: &Value, name: &str, depth: usize, cells: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) if depth < DEEPEST => {
            let joined = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
            map.iter().for_each(|(key, value)| flat(value, &joined(key), depth + 1, cells));
        }
        other => cells.extend(cell(other).map(|cell| (plain(name), cell))),
    }
}

/// The text of one value; none of a list or an object.
fn cell(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(plain(text)),
        Value::Array(_) | Value::Object(_) => None,
        other => Some(other.to_string()),
    }
}

/// A table's lines and cells end where they end here.
fn plain(text: &str) -> String {
    text.replace(|c: char| c.is_control() || c == '"', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_columns_and_rows_are_the_same_table() {
        let text = "t\tP1 (bar)\n0\t5.9\n0.5\tnull\n1\t5.8\n";
        for json in [
            r#"[{"t":0,"P1 (bar)":5.9},{"t":0.5,"P1 (bar)":null},{"t":1,"P1 (bar)":5.8}]"#,
            "{\"t\":0,\"P1 (bar)\":5.9}\n{\"t\":0.5,\"P1 (bar)\":null}\n{\"t\":1,\"P1 (bar)\":5.8}\n",
            r#"{"t":[0,0.5,1],"P1 (bar)":[5.9,null,5.8]}"#,
            r#"{"t":{"0":0,"1":0.5,"2":1},"P1 (bar)":{"0":5.9,"1":null,"2":5.8}}"#,
            r#"{"columns":["t","P1 (bar)"],"data":[[0,5.9],[0.5,null],[1,5.8]]}"#,
            r#"[["t","P1 (bar)"],[0,5.9],[0.5,null],[1,5.8]]"#,
        ] {
            assert!(is_json(json.as_bytes()), "{json}");
            let found = tables_of_json(json.as_bytes()).unwrap();
            let mut columns: Vec<Vec<&str>> = vec![Vec::new(); 2];
            found.texts[0]
                .1
                .lines()
                .for_each(|line| line.split('\t').zip(&mut columns).for_each(|(cell, column)| column.push(cell)));
            columns.sort();
            let mut expected: Vec<Vec<&str>> = vec![Vec::new(); 2];
            text.lines()
                .for_each(|line| line.split('\t').zip(&mut expected).for_each(|(cell, column)| column.push(cell)));
            expected.sort();
            assert_eq!(columns, expected, "{json}");
        }
    }

    #[test]
    fn what_stands_beside_the_table_is_a_remark_and_other_forms_are_refused() {
        let found = tables_of_json(br#"{"sample_rate":1000,"data":{"P1":[1,2,3],"note":["a","b"]}}"#).unwrap();
        assert_eq!(found.texts[0].1, "# sample_rate: 1000\nP1\n1\n2\n3\n");
        assert_eq!(found.left_out, [("note".to_owned(), "2 values where others have 3".to_owned())]);
        let ten: String = (0..12).map(|i| format!(r#""{i}":{i},"#)).collect();
        let found = tables_of_json(format!(r#"{{"P1":{{{}}}}}"#, ten.trim_end_matches(',')).as_bytes()).unwrap();
        assert!(found.texts[0].1.starts_with("P1\n0\n1\n2\n"), "in the order of the places");
        for other in [r#"{"a":1}"#, "[1,2", r#"[{"a":[1,2]}]"#] {
            assert!(tables_of_json(other.as_bytes()).is_err(), "{other}");
        }
        assert!(!is_json(b"[Header]\na,b\n") && !is_json(b"time_s,P1\n"));
    }
}
