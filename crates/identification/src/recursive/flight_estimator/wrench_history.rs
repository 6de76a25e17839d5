//! The believed wrenches and what was stored in the last seconds.

use crate::lie::Wrench;
use nalgebra::{Vector3, Vector6};
use std::collections::VecDeque;

/// What is believed to act over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Held {
    pub(super) wrench: Wrench<f64>,
    /// Angular momentum of wheels.
    pub(super) stored: Vector3<f64>,
}

/// Pieces kept: a minute of control periods of 16 ms.
const PIECES: usize = 4096;

#[derive(Clone, Copy, Debug)]
struct Piece {
    from_ns: i64,
    until_ns: i64,
    wrench: Vector6<f64>,
    stored: Vector3<f64>,
}

/// Wrenches held over spans of time, in order and without overlap; zero between them.
#[derive(Clone, Debug)]
pub(super) struct WrenchHistory {
    pieces: VecDeque<Piece>,
    end_ns: i64,
}

impl WrenchHistory {
    pub(super) fn new(start_ns: i64) -> Self {
        Self { pieces: VecDeque::with_capacity(PIECES), end_ns: start_ns }
    }

    /// Until when something has been said.
    pub(super) fn end_ns(&self) -> i64 {
        self.end_ns
    }

    /// Since when everything that was said is known.
    pub(super) fn complete_since_ns(&self) -> i64 {
        if self.pieces.len() < PIECES { i64::MIN } else { self.pieces.front().map_or(i64::MIN, |piece| piece.from_ns) }
    }

    /// Holds a wrench over a span; what had been said of that time and later is forgotten.
    pub(super) fn hold(&mut self, from_ns: i64, until_ns: i64, wrench: &Wrench<f64>, stored: &Vector3<f64>) {
        while self.pieces.back().is_some_and(|piece| piece.from_ns >= from_ns) {
            self.pieces.pop_back();
        }
        let wrench = wrench.to_vector();
        self.end_ns = until_ns;
        if let Some(last) = self.pieces.back_mut() {
            last.until_ns = last.until_ns.min(from_ns);
            if last.until_ns == from_ns && last.wrench == wrench && last.stored == *stored {
                last.until_ns = until_ns;
                return;
            }
        }
        if self.pieces.len() == PIECES {
            self.pieces.pop_front();
        }
        self.pieces.push_back(Piece { from_ns, until_ns, wrench, stored: *stored });
    }

    /// The mean over a span.
    pub(super) fn mean(&self, from_ns: i64, until_ns: i64) -> Held {
        let whole = (until_ns - from_ns) as f64;
        let first = self.pieces.partition_point(|piece| piece.until_ns <= from_ns);
        let (mut sum, mut stored) = (Vector6::zeros(), Vector3::zeros());
        for piece in self.pieces.iter().skip(first).take_while(|piece| piece.from_ns < until_ns) {
            let part = (piece.until_ns.min(until_ns) - piece.from_ns.max(from_ns)) as f64;
            sum += piece.wrench * (part / whole);
            stored += piece.stored * (part / whole);
        }
        Held { wrench: sum.into(), stored }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hold(history: &mut WrenchHistory, from_ns: i64, until_ns: i64, x: f64) {
        let force = Vector6::new(0.0, 0.0, 0.0, x, 0.0, 0.0).into();
        history.hold(from_ns, until_ns, &force, &Vector3::new(0.0, 2.0 * x, 0.0));
    }

    #[test]
    fn means_by_hand() {
        let mut history = WrenchHistory::new(0);
        hold(&mut history, 0, 10, 1.0);
        hold(&mut history, 10, 20, 3.0);
        // A gap, then the last piece is said anew.
        hold(&mut history, 40, 50, 9.0);
        hold(&mut history, 45, 55, 5.0);
        let mean = |from, until| {
            let held = history.mean(from, until);
            assert!((held.stored.y - 2.0 * held.wrench.force.x).abs() < 1e-14);
            held.wrench.force.x
        };
        assert!((mean(0, 10) - 1.0).abs() < 1e-15);
        assert!((mean(5, 15) - 2.0).abs() < 1e-15);
        assert!((mean(15, 45) - (15.0 + 45.0) / 30.0).abs() < 1e-15);
        assert!((mean(40, 55) - (45.0 + 50.0) / 15.0).abs() < 1e-15);
        assert_eq!((mean(20, 40), mean(60, 70), history.end_ns()), (0.0, 0.0, 55));
    }

    #[test]
    fn equal_neighbours_are_one_and_the_oldest_go_first() {
        let mut history = WrenchHistory::new(0);
        for i in 0..9000 {
            hold(&mut history, i, i + 1, 7.0);
        }
        assert_eq!((history.pieces.len(), history.mean(0, 9000).wrench.force.x), (1, 7.0));
        for i in 9000..14000 {
            hold(&mut history, i, i + 1, i as f64);
        }
        assert_eq!((history.pieces.len(), history.mean(13999, 14000).wrench.force.x), (PIECES, 13999.0));
        assert!(history.mean(9000, 9001).wrench.force.x.abs() < 1e-300);
    }
}
