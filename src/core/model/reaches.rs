//! Number of reaches for pipes in series.

/// Fewest reaches at which none of the pipes with these travel times is shorter than a reach: one each, two in all.
pub fn least_reaches(travel_s: &[f64]) -> usize {
    let total_s: f64 = travel_s.iter().sum();
    let shortest = travel_s.iter().copied().fold(f64::INFINITY, f64::min);
    let joints = travel_s.len() - 1;
    ((total_s / shortest * (1.0 - 1e-9)).ceil() as usize + joints).max(2)
}

/// The number of reaches, from `reaches` to a quarter more, whose nodes come nearest to all joints of pipes in series.
/// A joint on a node is exact; one between nodes disperses steep fronts a little each time they pass.
pub fn fitting_reaches(travel_s: &[f64], reaches: usize) -> usize {
    let total_s: f64 = travel_s.iter().sum();
    let misfit = |n: usize| {
        let mut end_s = 0.0;
        travel_s[..travel_s.len() - 1]
            .iter()
            .map(|t| {
                end_s += t;
                let x = end_s / total_s * n as f64;
                (x - x.round()).abs()
            })
            .fold(0.0, f64::max)
    };
    // The first of the best: `min_by` keeps it.
    (reaches..=reaches + reaches / 4).min_by(|&a, &b| misfit(a).total_cmp(&misfit(b))).unwrap_or(reaches)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reaches_are_chosen_to_put_joints_on_nodes() {
        // 40 ms and 16 ms: 5 and 2 reaches, or any multiple.
        assert_eq!(fitting_reaches(&[0.040, 0.016], 64), 70);
        assert_eq!(fitting_reaches(&[0.040, 0.016], 70), 70);
        assert_eq!(fitting_reaches(&[0.3], 64), 64);
        let n = fitting_reaches(&[0.1, 0.0437, 0.08], 100);
        assert!((100..=125).contains(&n));
    }

    #[test]
    fn the_shortest_pipe_asks_for_most() {
        assert_eq!(least_reaches(&[1.0]), 2);
        assert_eq!(least_reaches(&[1.0, 1.0]), 3);
        assert_eq!(least_reaches(&[1.0, 0.1]), 12);
    }
}
