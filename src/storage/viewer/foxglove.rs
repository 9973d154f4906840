//! A layout of Foxglove: a JSON file with a panel for each plot, and the tree that divides the window among them.

use serde_json::{Map, Value, json};

use crate::storage::viewer::plots::{FIELD, Plot};

/// The layout file.
pub fn layout(plots: &[Plot]) -> String {
    let panels: Map<String, Value> = plots.iter().enumerate().map(|(i, plot)| (id(i), panel(plot))).collect();
    let layout = json!({
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": { "speed": 1 },
        "layout": rows(0, plots.len()),
    });
    format!("{layout:#}\n")
}

fn id(plot: usize) -> String {
    format!("Plot!surgescope{}", plot + 1)
}

fn panel(plot: &Plot) -> Value {
    let paths = plot.curves.iter().map(|curve| {
        json!({
            "value": format!("{}.{FIELD}", topic(&curve.topic)),
            "label": curve.label,
            "enabled": true,
            // The log time is the sample's time.
            "timestampMethod": "receiveTime",
        })
    });
    json!({
        "foxglovePanelTitle": plot.title,
        "paths": paths.collect::<Vec<_>>(),
        "xAxisVal": "timestamp",
        "isSynced": true,
        "showXAxisLabels": true,
        "showYAxisLabels": true,
        "showLegend": true,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": false,
        "sidebarDimension": 240,
    })
}

/// A topic in a message path: between quotes where it holds more than letters, digits, `_` and `/`.
fn topic(name: &str) -> String {
    if name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '/') {
        return name.to_owned();
    }
    format!("\"{}\"", name.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Panels one below the other, of equal height.
fn rows(first: usize, end: usize) -> Value {
    if end - first <= 1 {
        return id(first).into();
    }
    json!({
        "first": id(first),
        "second": rows(first + 1, end),
        "direction": "column",
        "splitPercentage": 100.0 / (end - first) as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_that_is_no_identifier_stands_between_quotes() {
        assert_eq!(topic("/P_1/model"), "/P_1/model");
        assert_eq!(topic("/Drück 1"), "\"/Drück 1\"");
        assert_eq!(topic("/a\"b\\c"), "\"/a\\\"b\\\\c\"");
    }

    #[test]
    fn panels_share_the_height_equally() {
        assert_eq!(rows(0, 1), json!("Plot!surgescope1"));
        let three = rows(0, 3);
        assert_eq!(three["splitPercentage"], json!(100.0 / 3.0));
        assert_eq!(three["second"]["splitPercentage"], json!(50.0));
        assert_eq!(three["second"]["second"], json!("Plot!surgescope3"));
    }
}
