//! Number of reaches for the lines of a rig.

/// Travel times of a wave through the stretches of each line.
#[derive(Debug, Clone)]
pub struct Travel {
    /// By line, one stretch after the other, s.
    pub lines_s: Vec<Vec<f64>>,
    /// The lines on the way from the supply to the valve.
    pub way: Vec<usize>,
}

/// Most joints that are looked at for a number of reaches that fits.
const MOST_TRIED: usize = 10_000_000;

impl Travel {
    /// From the supply to the valve, s.
    pub fn way_s(&self) -> f64 {
        self.way.iter().flat_map(|&line| &self.lines_s[line]).sum()
    }

    /// Fewest reaches on the way from the supply to the valve at which no stretch is shorter than a reach: on a single
    /// line one each, two in all.
    pub fn least_reaches(&self) -> usize {
        let shortest = self.lines_s.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let joints = self.lines_s.iter().map(|line| line.len() - 1).max().unwrap_or(0);
        ((self.way_s() / shortest * (1.0 - 1e-9)).ceil() as usize + joints).max(2)
    }

    /// The number of reaches, from `reaches` to a quarter more, whose nodes come nearest to all joints and to the ends
    /// of all lines. A joint on a node is exact; one between nodes disperses steep fronts a little each time they pass.
    /// The same holds for the end of a line.
    pub fn fitting_reaches(&self, reaches: usize) -> usize {
        let way_s = self.way_s();
        let single = self.lines_s.len() == 1;
        let misfit = |n: usize| {
            let of = |line: &Vec<f64>| {
                let mut end_s = 0.0;
                line[..line.len() - usize::from(single)]
                    .iter()
                    .map(|t| {
                        end_s += t;
                        let x = end_s / way_s * n as f64;
                        (x - x.round()).abs()
                    })
                    .fold(0.0, f64::max)
            };
            self.lines_s.iter().map(of).fold(0.0, f64::max)
        };
        // So many lines have no number that fits them all: fewer are tried.
        let most = MOST_TRIED / self.lines_s.iter().map(Vec::len).sum::<usize>().max(1);
        // The first of the best: `min_by` keeps it.
        (reaches..=reaches + (reaches / 4).min(most))
            .min_by(|&a, &b| misfit(a).total_cmp(&misfit(b)))
            .unwrap_or(reaches)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(travel_s: &[f64]) -> Travel {
        Travel { lines_s: vec![travel_s.to_vec()], way: vec![0] }
    }

    #[test]
    fn reaches_are_chosen_to_put_joints_on_nodes() {
        // 40 ms and 16 ms: 5 and 2 reaches, or any multiple.
        assert_eq!(line(&[0.040, 0.016]).fitting_reaches(64), 70);
        assert_eq!(line(&[0.040, 0.016]).fitting_reaches(70), 70);
        assert_eq!(line(&[0.3]).fitting_reaches(64), 64);
        let n = line(&[0.1, 0.0437, 0.08]).fitting_reaches(100);
        assert!((100..=125).contains(&n));
        // A branch as well: 50 ms on the way, 15 ms beside it.
        let tee = Travel { lines_s: vec![vec![0.03], vec![0.02], vec![0.015]], way: vec![0, 1] };
        assert_eq!(tee.fitting_reaches(17), 20);
    }

    #[test]
    fn the_shortest_pipe_asks_for_most() {
        assert_eq!(line(&[1.0]).least_reaches(), 2);
        assert_eq!(line(&[1.0, 1.0]).least_reaches(), 3);
        assert_eq!(line(&[1.0, 0.1]).least_reaches(), 12);
        assert_eq!(Travel { lines_s: vec![vec![1.0], vec![1.0], vec![0.1]], way: vec![0, 1] }.least_reaches(), 20);
    }
}
