//! What a parameter means, in plain words for readers of a report.

/// Meaning of a parameter by its name; empty for a name that is not known, whose unit and effect must speak for it.
///
/// Numbered names (`J2_per_GPa`) are looked up without their number.
pub fn parameter(name: &str) -> &'static str {
    let plain: String = name.chars().filter(|c| !c.is_ascii_digit()).collect();
    MEANINGS.iter().find(|(known, _)| *known == name || *known == plain).map_or("", |(_, meaning)| meaning)
}

const MEANINGS: [(&str, &str); 11] = [
    ("wave_speed_m_s", "speed of pressure waves in the pipe: it sets the period of the oscillation, 4L/a"),
    ("friction_factor", "Darcy friction factor of the steady flow"),
    (
        "initial_velocity_m_s",
        "mean velocity of the water before the valve closes: it sets the height of the first rise",
    ),
    ("valve_head_m", "head upstream of the valve before it closes"),
    ("supply_head_m", "head of the supply"),
    ("reservoir_head_m", "head of the supply"),
    ("closure_start_s", "when the valve starts to close, on the recording's clock"),
    ("start_s", "when the valve starts to close, on the recording's clock"),
    ("closing_time_s", "how long the valve takes to close"),
    ("J_per_GPa", "creep compliance of the wall: how much further it yields after the first, elastic stretch"),
    ("tau_s", "retardation time: how long that part of the creep takes to develop"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbered_parameters_share_their_meaning() {
        assert_eq!(parameter("J1_per_GPa"), parameter("J12_per_GPa"));
        assert!(parameter("tau2_s").contains("retardation"));
        assert!(parameter("wave_speed_m_s").contains("4L/a"));
        assert_eq!(parameter("something_else"), "");
    }
}
