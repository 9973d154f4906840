//! A layout of PlotJuggler: an XML file with one tab, whose plots stand one below the other.
//!
//! Its reader of MCAP names a curve after topic and field: `/P1/value`.

use std::fmt::Write as _;

use crate::storage::viewer::plots::{FIELD, Plot};

/// Version of layouts that PlotJuggler 3 takes without asking.
const VERSION: &str = "2.3.8";
/// Colours in turn, distinguishable on white and on black.
const COLOURS: [&str; 8] = ["#1f77b4", "#d62728", "#1ac938", "#ff7f0e", "#f14cc1", "#9467bd", "#17becf", "#bcbd22"];

/// The layout file.
pub fn layout(plots: &[Plot]) -> String {
    let count = plots.len();
    let sizes = vec![format!("{:.6}", 1.0 / count.max(1) as f64); count].join(";");
    let mut areas = String::new();
    for plot in plots {
        areas += &area(plot);
    }
    format!(
        "\
<?xml version='1.0' encoding='UTF-8'?>
<root version=\"{VERSION}\">
 <tabbed_widget name=\"Main Window\" parent=\"main_window\">
  <Tab containers=\"1\" tab_name=\"surgescope\">
   <Container>
    <DockSplitter orientation=\"-\" count=\"{count}\" sizes=\"{sizes}\">
{areas}    </DockSplitter>
   </Container>
  </Tab>
  <currentTabIndex index=\"0\"/>
 </tabbed_widget>
 <use_relative_time_offset enabled=\"1\"/>
</root>
"
    )
}

fn area(plot: &Plot) -> String {
    let mut curves = String::new();
    for (curve, colour) in plot.curves.iter().zip(COLOURS.iter().cycle()) {
        let name = escaped(&format!("{}/{FIELD}", curve.topic));
        let _ = writeln!(curves, "       <curve name=\"{name}\" color=\"{colour}\"/>");
    }
    format!(
        "     <DockArea name=\"{}\">\n      <plot mode=\"TimeSeries\" style=\"Lines\" flip_x=\"false\" flip_y=\"false\">\n{curves}      \
         </plot>\n     </DockArea>\n",
        escaped(&plot.title)
    )
}

/// Text between the quotes of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::viewer::plots::Curve;

    #[test]
    fn a_name_cannot_break_out_of_its_attribute() {
        let curve = Curve { topic: "/a\"&<b".into(), label: String::new() };
        let text = layout(&[Plot { title: "Pressure, kPa".into(), curves: vec![curve] }]);
        assert!(text.contains("<curve name=\"/a&quot;&amp;&lt;b/value\" color="), "{text}");
        assert!(text.contains("count=\"1\" sizes=\"1.000000\""), "{text}");
    }
}
