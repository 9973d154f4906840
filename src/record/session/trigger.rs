//! When a shot begins and when it is over: by the edge of the valve's command, by a level, or by a slope. No clock and
//! no file in it: it is fed with the samples of its sensor and says what they mean.

use crate::storage::layout::offset_ns;

/// What fires a trigger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// The valve's command (0 or 1) goes past one half, whichever way.
    Edge,
    /// The value reaches this one from below, in the sensor's unit.
    Level(f64),
    /// The value rises by so many of its units a second, over [`SLOPE_SPAN_NS`].
    Slope(f64),
}

/// The stretch over which a slope is taken, ns: long against a sample's noise, short against a closure. At least from
/// one sample to the next.
pub const SLOPE_SPAN_NS: i64 = 20_000_000;

/// What a trigger does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// What fires it.
    pub condition: Condition,
    /// What a shot holds before the moment at which it fires, ns.
    pub pre_ns: i64,
    /// What a shot holds after it, ns.
    pub post_ns: i64,
}

/// What samples have brought about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// The signal was quiet for the time that a shot holds before it fires: from now on it may.
    Armed,
    /// It has fired, at this time.
    Fired(i64),
    /// The shot's last moment, this time, has passed.
    Over(i64),
}

/// How a trigger stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Waits until the condition has not been met for long enough: seen quiet for so long by now, ns. Gaps count for
    /// nothing.
    Settling(i64),
    /// It may fire.
    Armed,
    /// Fired at this time.
    Fired(i64),
}

/// A trigger at work on one sensor.
#[derive(Debug, Clone)]
pub struct Trigger {
    settings: Settings,
    state: State,
    /// The last samples, time in ns and value, as far back as a slope looks.
    last: std::collections::VecDeque<(i64, f64)>,
    /// Time of the sample before, ns, where nothing is missing since.
    newest_ns: Option<i64>,
    unheeded: usize,
}

impl Trigger {
    /// One that has seen nothing yet.
    pub fn new(settings: Settings) -> Trigger {
        Trigger {
            settings,
            state: State::Settling(0),
            last: std::collections::VecDeque::new(),
            newest_ns: None,
            unheeded: 0,
        }
    }

    /// How it stands.
    pub fn state(&self) -> State {
        self.state
    }

    /// How often the valve's command switched while the trigger settled, between shots or before the first: no shot
    /// shows it.
    pub fn unheeded_edges(&self) -> usize {
        self.unheeded
    }

    /// Takes samples of its sensor, `period_ns` apart, the first at `first_ns`; says what they bring about, in order.
    pub fn feed(&mut self, first_ns: i64, period_ns: f64, values: &[f64], events: &mut Vec<Event>) {
        for (i, &value) in values.iter().enumerate() {
            let at = first_ns.saturating_add(offset_ns(i, period_ns));
            self.forget(at);
            let met = self.is_met(at, value);
            self.last.push_back((at, value));
            let seen_ns = self.newest_ns.replace(at).map_or(0, |before| at.saturating_sub(before).max(0));
            let next = match self.state {
                State::Settling(_) if met => Some(State::Settling(0)),
                State::Settling(quiet) if quiet + seen_ns >= self.settings.pre_ns => Some(State::Armed),
                State::Settling(quiet) => Some(State::Settling(quiet + seen_ns)),
                State::Armed => met.then_some(State::Fired(at)),
                State::Fired(fired) => (at - fired > self.settings.post_ns).then_some(State::Settling(0)),
            };
            let is_edge = self.settings.condition == Condition::Edge;
            let in_no_shot = matches!((self.state, next), (State::Settling(_), _) | (State::Fired(_), Some(_)));
            self.unheeded += usize::from(met && is_edge && in_no_shot);
            let Some(next) = next else { continue };
            match (self.state, next) {
                (_, State::Armed) => events.push(Event::Armed),
                (_, State::Fired(at)) => events.push(Event::Fired(at)),
                (State::Fired(fired), _) => events.push(Event::Over(fired + self.settings.post_ns)),
                _ => {}
            }
            self.state = next;
        }
    }

    /// Samples are missing. What was armed stays so, and what the valve, a level or a slope did meanwhile shows in the
    /// next sample.
    pub fn gap(&mut self) {
        self.newest_ns = None;
    }

    fn is_met(&self, at: i64, value: f64) -> bool {
        match self.settings.condition {
            Condition::Edge => self.last.back().is_some_and(|(_, before)| (*before > 0.5) != (value > 0.5)),
            Condition::Level(level) => value >= level,
            Condition::Slope(least) => self.last.front().is_some_and(|&(then, before)| {
                let span_s = (at - then) as f64 * 1e-9;
                span_s > 0.0
                    && (at - then >= SLOPE_SPAN_NS || self.last.len() == 1)
                    && (value - before) / span_s >= least
            }),
        }
    }

    /// Keeps the youngest sample that is a span old at this time, and those after it; of a command only the last.
    fn forget(&mut self, at: i64) {
        let only_last = self.settings.condition == Condition::Edge;
        while self.last.get(1).is_some_and(|(next, _)| only_last || at - next >= SLOPE_SPAN_NS) {
            self.last.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Feeds samples 1 ms apart in batches of 7.
    fn events(condition: Condition, pre_ms: i64, post_ms: i64, values: &[f64]) -> Vec<Event> {
        let mut trigger = Trigger::new(Settings { condition, pre_ns: pre_ms * MS, post_ns: post_ms * MS });
        let mut events = Vec::new();
        for (batch, values) in values.chunks(7).enumerate() {
            trigger.feed(batch as i64 * 7 * MS, 1e6, values, &mut events);
        }
        events
    }

    fn steps(parts: &[(usize, f64)]) -> Vec<f64> {
        parts.iter().flat_map(|&(n, v)| std::iter::repeat_n(v, n)).collect()
    }

    #[test]
    fn an_edge_fires_once_a_shot_and_is_armed_again() {
        let command = steps(&[(50, 0.0), (30, 1.0), (60, 0.0), (25, 1.0)]);
        let shot = |armed: bool, at: i64| {
            let mut all = if armed { vec![Event::Armed] } else { vec![] };
            all.extend([Event::Fired(at * MS), Event::Over((at + 20) * MS)]);
            all
        };
        let found = events(Condition::Edge, 10, 20, &command);
        // closes at 50, opens at 80 (before it is armed again: only 8 ms after the shot), closes at 140
        let expected = [shot(true, 50), shot(true, 140)].concat();
        assert_eq!(found, expected);
        // with less to hold before a shot, the valve's opening is a shot of its own
        assert_eq!(
            events(Condition::Edge, 5, 20, &command),
            [shot(true, 50), shot(true, 80), shot(true, 140)].concat()
        );
    }

    #[test]
    fn a_level_does_not_fire_while_the_surge_rings() {
        let mut pressure = steps(&[(40, 100.0)]);
        // twelve swings of 30 ms, then quiet
        pressure.extend((0..360).map(|i| 100.0 + 80.0 * (i as f64 * std::f64::consts::TAU / 30.0).sin()));
        pressure.extend(steps(&[(100, 100.0), (5, 200.0)]));
        let found = events(Condition::Level(150.0), 30, 60, &pressure);
        let fired: Vec<&Event> = found.iter().filter(|e| matches!(e, Event::Fired(_))).collect();
        assert_eq!(fired, [&Event::Fired(44 * MS), &Event::Fired(500 * MS)], "{found:?}");
    }

    #[test]
    fn a_slope_fires_on_a_rise_and_not_on_noise_or_drift() {
        let noise = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut pressure: Vec<f64> = (0..200).map(|i| 100.0 + 0.02 * i as f64 + noise(i)).collect();
        pressure.extend((0..40).map(|i| 104.0 + 4.0 * i as f64 + noise(i)));
        let found = events(Condition::Slope(1000.0), 50, 30, &pressure);
        let Some(Event::Fired(at)) = found.get(1) else { panic!("{found:?}") };
        assert!((200 * MS..210 * MS).contains(at), "the rise of 4000 a second starts at 200 ms: {at}");
    }

    #[test]
    fn nothing_fires_before_there_is_enough_to_hold() {
        assert_eq!(events(Condition::Level(1.0), 10, 10, &steps(&[(100, 2.0)])), []);
        assert_eq!(events(Condition::Edge, 10, 10, &steps(&[(5, 0.0), (20, 1.0)])), [Event::Armed]);
    }

    #[test]
    fn gaps_do_not_disarm_and_an_edge_within_one_fires() {
        let settings = Settings { condition: Condition::Edge, pre_ns: 10 * MS, post_ns: 20 * MS };
        let (mut trigger, mut events) = (Trigger::new(settings), Vec::new());
        // never more than 5 samples, 4 ms, in a row: armed after three such stretches
        for stretch in 0..3 {
            assert_eq!(trigger.state(), State::Settling(stretch * 4 * MS));
            trigger.feed(stretch * 20 * MS, 1e6, &[0.0; 5], &mut events);
            trigger.gap();
        }
        assert_eq!(events, [Event::Armed]);
        trigger.feed(100 * MS, 1e6, &[1.0; 5], &mut events);
        assert_eq!(events, [Event::Armed, Event::Fired(100 * MS)]);
        assert_eq!(trigger.unheeded_edges(), 0);
    }

    /// Within a shot it is on record, where the trigger settles it is not; a level that the ringing reaches again and
    /// again is no closure.
    #[test]
    fn edges_that_make_no_shot_are_counted() {
        let count = |condition| {
            let mut trigger = Trigger::new(Settings { condition, pre_ns: 10 * MS, post_ns: 20 * MS });
            let mut events = Vec::new();
            // at 5 while it settles, at 30 it fires, at 40 within the shot, at 51 just behind it, at 55 while it
            // settles again
            let command = steps(&[(5, 0.0), (25, 1.0), (10, 0.0), (11, 1.0), (4, 0.0), (60, 1.0)]);
            trigger.feed(0, 1e6, &command, &mut events);
            (events.iter().filter(|e| matches!(e, Event::Fired(_))).count(), trigger.unheeded_edges())
        };
        assert_eq!(count(Condition::Edge), (1, 3));
        assert_eq!(count(Condition::Level(0.9)).1, 0);
    }

    /// Where the mean slope across what is missing is as steep as asked for, the slope itself was, somewhere in it
    /// (mean value theorem): a front in a damaged frame is a closure all the same. A slow rise in a long gap is none,
    /// though its step is as high.
    #[test]
    fn a_level_and_a_slope_are_compared_across_a_gap() {
        let found = |condition, next_ms| {
            let (mut trigger, mut events) =
                (Trigger::new(Settings { condition, pre_ns: 10 * MS, post_ns: 20 * MS }), Vec::new());
            trigger.feed(0, 1e6, &[1.0; 20], &mut events);
            trigger.gap();
            trigger.feed(next_ms * MS, 1e6, &[9.0; 5], &mut events);
            events
        };
        assert_eq!(found(Condition::Level(5.0), 30), [Event::Armed, Event::Fired(30 * MS)]);
        // the last sample came at 19 ms: 8 in 20 ms, 8 in 26 ms, 8 in 81 ms and more
        assert_eq!(found(Condition::Slope(300.0), 30), [Event::Armed, Event::Fired(30 * MS)]);
        assert_eq!(found(Condition::Slope(300.0), 45), [Event::Armed, Event::Fired(45 * MS)]);
        assert_eq!(found(Condition::Slope(100.0), 100), [Event::Armed]);
    }
}
