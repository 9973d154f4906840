//! Places on a rig's pipes, and the way from the supply to the valve.

use crate::rig::graph::Place;
use crate::rig::types::{Pipe, Rig, Sensor};

impl Rig {
    /// Length of the pipes from the supply to the valve, m.
    pub fn length_m(&self) -> f64 {
        self.way_pipes().map(|p| p.length_m).sum()
    }

    /// Standard deviation of that length, as a share of it.
    pub fn length_tolerance(&self) -> f64 {
        let square: f64 = self.way_pipes().map(|p| (p.length_m * p.tolerance.length).powi(2)).sum();
        square.sqrt() / self.length_m()
    }

    /// Standard deviation of the place of a sensor between the ends, m. A wrong length moves it, too: the model keeps
    /// the file's length, and its wave speed takes up the difference.
    pub fn place_sd_m(&self, sensor: &Sensor) -> f64 {
        sensor.position_sd_m.hypot(self.length_m() * self.length_tolerance())
    }

    /// Standard deviation of a fitted parameter through the rig file's tolerances, as a share of its value; none where
    /// they do not reach it.
    ///
    /// The record gives travel times: what it says in metres scales with the length. It gives the wall's compliance
    /// over its thickness: creep scales with `e/D`.
    pub fn tolerance_of(&self, parameter: &str) -> Option<f64> {
        let of_name =
            |text: &str| parameter.strip_prefix(text).and_then(|rest| rest.strip_prefix('[')?.strip_suffix(']'));
        let pipe = of_name("wave_speed_m_s").and_then(|name| self.pipes.iter().find(|p| p.name == name));
        let share = match parameter {
            _ if pipe.is_some() => pipe?.tolerance.length,
            "wave_speed_m_s" => self.length_tolerance(),
            _ if of_name("position_m").is_some() => return None,
            _ if parameter.ends_with("position_m") || parameter.ends_with("length_m") => self.length_tolerance(),
            _ if parameter.ends_with("_per_GPa") => {
                self.pipes.iter().map(|p| p.tolerance.diameter.hypot(p.tolerance.wall)).fold(0.0, f64::max)
            }
            _ => return None,
        };
        (share > 0.0).then_some(share)
    }

    /// Length of a line, m.
    pub fn line_length_m(&self, line: usize) -> f64 {
        self.pipes_of(line).iter().map(|p| p.length_m).sum()
    }

    /// The pipes of a line.
    pub fn pipes_of(&self, line: usize) -> &[Pipe] {
        &self.pipes[self.graph.lines[line].pipes.clone()]
    }

    /// Indices of the pipes on the way from the supply to the valve, in that order.
    pub fn way(&self) -> impl Iterator<Item = usize> {
        self.graph.way.iter().flat_map(|&(line, _)| self.graph.lines[line].pipes.clone())
    }

    /// The pipes on the way from the supply to the valve, in that order.
    pub fn way_pipes(&self) -> impl Iterator<Item = &Pipe> {
        self.way().map(|i| &self.pipes[i])
    }

    /// The pipe that ends at the valve.
    pub fn pipe_at_valve(&self) -> &Pipe {
        &self.pipes[self.graph.lines[self.graph.line_to_valve()].pipes.end - 1]
    }

    /// The place of the valve.
    pub fn valve_place(&self) -> Place {
        let line = self.graph.line_to_valve();
        Place { line, position_m: self.line_length_m(line) }
    }

    /// Where a place lies on the way from the supply to the valve, m: as far before the valve as a wave comes on the
    /// shortest way from it.
    pub fn on_way_m(&self, place: Place) -> f64 {
        let lengths_m: Vec<f64> = (0..self.graph.lines.len()).map(|line| self.line_length_m(line)).collect();
        let mut before_m = 0.0;
        for &(line, backwards) in &self.graph.way {
            if line == place.line {
                return before_m + if backwards { lengths_m[line] - place.position_m } else { place.position_m };
            }
            before_m += lengths_m[line];
        }
        let from_valve = self.graph.distances(self.graph.valve, &lengths_m);
        let line = &self.graph.lines[place.line];
        let by_start_m = from_valve[line.from].0 + place.position_m;
        let by_end_m = from_valve[line.to].0 + lengths_m[place.line] - place.position_m;
        self.length_m() - by_start_m.min(by_end_m)
    }

    /// The place at a distance from the supply, on the way to the valve.
    pub fn at_way_m(&self, mut position_m: f64) -> Place {
        for &(line, backwards) in &self.graph.way {
            let length_m = self.line_length_m(line);
            if position_m <= length_m {
                return Place { line, position_m: if backwards { length_m - position_m } else { position_m } };
            }
            position_m -= length_m;
        }
        self.valve_place()
    }

    /// Elevation of the pipe's axis at a place, m (linear along each pipe).
    pub fn elevation_m(&self, place: impl Into<Place>) -> f64 {
        let Place { line, position_m } = place.into();
        let pipes = self.pipes_of(line);
        let mut start = 0.0;
        for (i, pipe) in pipes.iter().enumerate() {
            if position_m <= start + pipe.length_m || i + 1 == pipes.len() {
                let part = ((position_m - start) / pipe.length_m).clamp(0.0, 1.0);
                return pipe.elevation_start_m + part * (pipe.elevation_end_m - pipe.elevation_start_m);
            }
            start += pipe.length_m;
        }
        0.0
    }

    /// What positions on a line count along, in words: `from the supply`; in a network `along branch`.
    pub fn along_words(&self, line: usize) -> String {
        match self.graph.lines.len() {
            1 => "from the supply".to_owned(),
            _ => format!("along {}", self.pipes_of(line)[0].name),
        }
    }

    /// A place in words: `40.0 m`; in a network `40.0 m along branch`.
    pub fn place_words(&self, Place { line, position_m }: Place) -> String {
        let along = if self.graph.lines.len() > 1 { format!(" {}", self.along_words(line)) } else { String::new() };
        format!("{position_m:.1} m{along}")
    }

    /// Elevation of a sensor, m: its own, or that of the pipe's axis at its place.
    pub fn sensor_elevation_m(&self, sensor: &Sensor) -> f64 {
        sensor.elevation_m.unwrap_or_else(|| self.elevation_m(sensor.place()))
    }
}
