//! Where on a segment a gap is least.

use super::gap::{Approach, Place};

/// Most gaps that a search looks at before it gives up and answers a lower bound.
const LOOKS: usize = 32;
/// Two places so near to each other, one where the gap falls and one where it rises, are the sides of a kink.
const KINK: f64 = 1e-9;

/// A piece of a segment between two places looked at.
#[derive(Clone, Copy)]
struct Piece {
    from: Place,
    to: Place,
    /// The gap is not below this.
    bound_m: f64,
    /// Where the two tangents meet.
    meet: f64,
}

impl Piece {
    /// `gap + bend s^2 / 2` is convex, hence above its tangents.
    fn new(from: Place, to: Place, bend: f64) -> Self {
        let width = to.s - from.s;
        let closing = to.slope + bend * width - from.slope;
        let gaps = (from.gap.distance_m, to.gap.distance_m);
        let along = (gaps.0 - gaps.1 + (to.slope + 0.5 * bend * width) * width) / closing;
        let along = if closing > 0.0 { along.clamp(0.0, width) } else { 0.5 * width };
        let lowest = gaps.0 + (from.slope - 0.5 * bend * along) * along;
        Self { from, to, bound_m: lowest.min(gaps.0).min(gaps.1), meet: from.s + along }
    }
}

/// Where the gap is least.
pub(super) struct Closest {
    /// The place; where the gap has a kink there (depths have), both sides of it.
    pub sides: [Place; 2],
    /// How much the second side counts: together they are stationary.
    pub share: f64,
    /// How much less the gap may be elsewhere, m: not more than the tolerance, unless the search was given up.
    pub short_m: f64,
}

impl Closest {
    fn at(place: Place) -> Self {
        Self { sides: [place, place], share: 0.0, short_m: 0.0 }
    }
}

/// The place of the least gap.
pub(super) fn closest(approach: &Approach<'_>, tolerance_m: f64) -> Closest {
    let (_, bend) = approach.bounds();
    let whole = Piece::new(approach.at(0.0), approach.at(1.0), bend);
    let mut pieces = [whole; LOOKS];
    let mut count = 1;
    let mut best = nearer(whole.from, whole.to);
    // The neighbours of the best place.
    let (mut before, mut after) = (whole.from, whole.to);
    let mut short_m = 0.0;
    while count <= LOOKS {
        let Some(open) = pieces.get_mut(..count) else { break };
        let Some(lowest) = open.iter_mut().min_by(|a, b| a.bound_m.total_cmp(&b.bound_m)) else { break };
        short_m = best.gap.distance_m - lowest.bound_m;
        let is_found = short_m <= tolerance_m;
        if is_found || count == LOOKS {
            break;
        }
        let Piece { from, to, meet, .. } = *lowest;
        let sixth = (to.s - from.s) / 6.0;
        let middle = approach.at(meet.clamp(from.s + sixth, to.s - sixth));
        *lowest = Piece::new(from, middle, bend);
        if let Some(next) = pieces.get_mut(count) {
            *next = Piece::new(middle, to, bend);
        }
        count += 1;
        if middle.gap.distance_m < best.gap.distance_m {
            (before, best, after) = (from, middle, to);
        } else if middle.s < best.s {
            before = if middle.s > before.s { middle } else { before };
        } else {
            after = if middle.s < after.s { middle } else { after };
        }
    }
    let found = polished(approach, if best.slope < 0.0 { (best, after) } else { (before, best) }, best);
    Closest { short_m, ..found }
}

fn nearer(a: Place, b: Place) -> Place {
    if b.gap.distance_m < a.gap.distance_m { b } else { a }
}

/// The stationary point between two neighbours, of which the best place is one, by regula falsi (Illinois) on the slope.
fn polished(approach: &Approach<'_>, (mut low, mut high): (Place, Place), best: Place) -> Closest {
    let is_inward = if best.s <= low.s { best.slope < 0.0 } else { best.slope > 0.0 };
    if !is_inward || low.s >= high.s {
        return Closest::at(best);
    }
    let mut nearest = best;
    let scale = 1e-10 * (low.slope.abs() + high.slope.abs());
    let (mut low_slope, mut high_slope, mut kept) = (low.slope, high.slope, 0);
    for _ in 0..80 {
        let width = high.s - low.s;
        let is_bracket = low_slope < 0.0 && high_slope > 0.0;
        let share = if is_bracket { low_slope / (low_slope - high_slope) } else { 0.5 };
        let middle = approach.at(low.s + share.clamp(1e-3, 1.0 - 1e-3) * width);
        nearest = nearer(nearest, middle);
        if middle.slope.abs() <= scale {
            // Rounding may leave a place looked at before a little nearer.
            let is_least = middle.gap.distance_m <= nearest.gap.distance_m + 1e-12 * approach.part.radius_m();
            return Closest::at(if is_least { middle } else { nearest });
        }
        if width < KINK && is_bracket {
            let share = low.slope / (low.slope - high.slope);
            return Closest { sides: [low, high], share, short_m: 0.0 };
        }
        // A place that falls but is no nearer lies beyond a rise.
        if middle.slope < 0.0 && (high_slope > 0.0 || middle.gap.distance_m <= best.gap.distance_m) {
            (low, low_slope) = (middle, middle.slope);
            if kept == -1 {
                high_slope *= 0.5;
            }
            kept = -1;
        } else {
            (high, high_slope) = (middle, middle.slope);
            if kept == 1 {
                low_slope *= 0.5;
            }
            kept = 1;
        }
    }
    Closest::at(nearest)
}
