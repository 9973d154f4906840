//! Tables in JSON: records, one object a line, columns, or rows under their names. What stands beside them goes above
//! the table as a remark.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

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
    let values = serde_json::Deserializer::from_slice(text).into_iter::<Value>().collect::<Result<Vec<_>, _>>();
    let mut values = values.map_err(|fault| format!("this is no whole JSON ({fault}): save it anew, or as CSV"))?;
    let whole = if values.len() == 1 { values.remove(0) } else { Value::List(values) };
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

/// A value; of an object the names in the file's order.
#[derive(Debug, Clone)]
enum Value {
    /// A number, a word, or `null`, as a cell of a table holds it.
    Cell(String),
    List(Vec<Value>),
    Object(Map),
}

type Map = Vec<(String, Value)>;

impl Value {
    fn as_list(&self) -> Option<&[Value]> {
        if let Value::List(items) = self { Some(items) } else { None }
    }

    fn as_object(&self) -> Option<&Map> {
        if let Value::Object(map) = self { Some(map) } else { None }
    }

    fn as_cell(&self) -> Option<&str> {
        if let Value::Cell(cell) = self { Some(cell) } else { None }
    }
}

fn get<'m>(map: &'m Map, name: &str) -> Option<&'m Value> {
    map.iter().find(|(own, _)| own == name).map(|(_, value)| value)
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Value, D::Error> {
        from.deserialize_any(AnyValue)
    }
}

struct AnyValue;

impl<'de> Visitor<'de> for AnyValue {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Cell(u8::from(value).to_string()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Cell(value.to_string()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(Value::Cell(value.to_string()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Value::Cell(value.to_string()))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(Value::Cell(plain(value)))
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Cell("null".to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Value::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some((name, value)) = entries.next_entry::<String, Value>()? {
            map.push((plain(&name), value));
        }
        Ok(Value::Object(map))
    }
}

/// Columns by their names, in the file's order, and what stands beside them.
#[derive(Default)]
struct Found {
    columns: Vec<(String, Vec<String>)>,
    remarks: Vec<(String, String)>,
}

impl Found {
    fn take(&mut self, value: &Value, name: &str, depth: usize) {
        let all = |items: &[Value], is: fn(&Value) -> bool| !items.is_empty() && items.iter().all(is);
        match value {
            Value::List(items) if all(items, has_samples) => self.channels(items),
            Value::List(items) if all(items, |item| item.as_object().is_some()) => self.records(items),
            Value::List(items) if all(items, |item| item.as_list().is_some()) => self.rows(items),
            Value::List(items) if all(items, |item| item.as_cell().is_some()) => {
                let cells = items.iter().filter_map(Value::as_cell).map(str::to_owned);
                self.columns.push((name.to_owned(), cells.collect()));
            }
            Value::Object(map) if let Some((names, rows)) = split(map) => {
                if let Some(index) = get(map, "index") {
                    self.take(index, "index", 1);
                }
                self.rows(&std::iter::once(names).chain(rows).cloned().collect::<Vec<_>>());
            }
            Value::Object(map) if depth > 0 && by_index(map) => self.indexed(map, name),
            Value::Object(map) if depth < DEEPEST => {
                map.iter().for_each(|(name, value)| self.take(value, name, depth + 1));
            }
            Value::Cell(cell) => self.remarks.push((name.to_owned(), cell.clone())),
            _ => {}
        }
    }

    /// `[{"name": "P1", "unit": "bar", "samples": [5.9, …]}, …]`.
    fn channels(&mut self, items: &[Value]) {
        for map in items.iter().filter_map(Value::as_object) {
            let said = |key: &str| get(map, key).and_then(Value::as_cell);
            let unit = said("unit").map_or(String::new(), |unit| format!(" ({unit})"));
            for (key, value) in map.iter().filter(|(_, value)| value.as_list().is_some()) {
                self.take(value, &(said("name").unwrap_or(key).to_owned() + &unit), 1);
            }
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
        let cell = |item: &Value| item.as_cell().unwrap_or_default().to_owned();
        let cells = |row: &Value| row.as_list().map(|row| row.iter().map(cell).collect::<Vec<_>>());
        let mut rows: Vec<Vec<String>> = items.iter().filter_map(cells).collect();
        let is_named = rows[0].iter().all(|name| name.parse::<f64>().is_err());
        let names = if is_named { rows.remove(0) } else { Vec::new() };
        for at in 0..rows.iter().map(Vec::len).max().unwrap_or(0) {
            let column = rows.iter().map(|row| row.get(at).cloned().unwrap_or_default()).collect();
            self.columns.push((names.get(at).cloned().unwrap_or_else(|| (at + 1).to_string()), column));
        }
    }

    /// `"P1": {"0": 5.9, "1": 5.8}`: each value under its place or its time.
    fn indexed(&mut self, map: &Map, name: &str) {
        let mut keyed: Vec<(&str, &str)> =
            map.iter().filter_map(|(key, value)| Some((key.as_str(), value.as_cell()?))).collect();
        keyed.sort_by(|(a, _), (b, _)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => a.total_cmp(&b),
            _ => a.cmp(b),
        });
        let counts = keyed.iter().enumerate().all(|(place, (key, _))| *key == place.to_string());
        if !counts && !self.columns.iter().any(|(other, _)| other == "index") {
            self.columns.push(("index".to_owned(), keyed.iter().map(|(key, _)| (*key).to_owned()).collect()));
        }
        self.columns.push((name.to_owned(), keyed.into_iter().map(|(_, cell)| cell.to_owned()).collect()));
    }
}

/// Names and rows of `{"columns": ["t", "P1"], "data": [[0, 5.9], …], "index": […]}`, as pandas splits a table.
fn split(map: &Map) -> Option<(&Value, &[Value])> {
    let names = get(map, "columns").filter(|names| names.as_list().is_some())?;
    Some((names, get(map, "data")?.as_list()?))
}

/// Whether an object holds the values of a column, each under its place or its time.
fn by_index(map: &Map) -> bool {
    let is_place = |key: &str| key.starts_with(|c: char| c.is_ascii_digit());
    map.len() > 1 && map.iter().all(|(key, value)| is_place(key) && value.as_cell().is_some())
}

/// Whether an object holds the samples of one channel, and what it is called.
fn has_samples(value: &Value) -> bool {
    let Some(map) = value.as_object() else { return false };
    let of = |is: fn(&Value) -> bool| map.iter().filter(|(_, value)| is(value)).count();
    of(|value| value.as_list().is_some()) == 1 && of(|value| value.as_object().is_some()) == 0
}

/// The cells of a record, by their names; of what stands within it by both.
fn flat(value: &Value, name: &str, depth: usize, cells: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) if depth < DEEPEST => {
            let joined = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
            map.iter().for_each(|(key, value)| flat(value, &joined(key), depth + 1, cells));
        }
        Value::Cell(cell) => cells.push((name.to_owned(), cell.clone())),
        _ => {}
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
            assert_eq!(found.texts[0].1, text, "{json}");
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
        let channels = r#"{"fs":1000,"channels":[{"name":"P1","unit":"bar","samples":[1,2]},{"name":"P2","unit":"psi","samples":[3,4]}]}"#;
        let found = tables_of_json(channels.as_bytes()).unwrap();
        assert_eq!(found.texts[0].1, "# fs: 1000\nP1 (bar)\tP2 (psi)\n1\t3\n2\t4\n");
        for other in [r#"{"a":1}"#, "[1,2", r#"[{"a":[{"b":1}]}]"#] {
            assert!(tables_of_json(other.as_bytes()).is_err(), "{other}");
        }
        assert!(!is_json(b"[Header]\na,b\n") && !is_json(b"time_s,P1\n"));
    }
}
