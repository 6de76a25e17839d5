//! Putting late samples back in their place, with bounded memory and latency.

use core::marker::PhantomData;

/// A sample that waits for its turn.
#[derive(Clone, Copy, Debug)]
pub struct Held<S> {
    time_ns: i64,
    /// Samples of one time leave in the order they came in.
    arrival: u64,
    sample: S,
}

impl<S> Held<S> {
    fn key(&self) -> (i64, u64) {
        (self.time_ns, self.arrival)
    }
}

/// A sample whose turn has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Released<S> {
    /// Its time stamp, ns.
    pub time_ns: i64,
    /// The sample.
    pub sample: S,
    /// False for a sample that came too late: a later one had already been released.
    pub in_order: bool,
}

/// Sorts a stream by time stamp, holding back at most as many samples as `storage` has places.
///
/// What goes in comes out, once: a sample overtaken by no more samples than there are places comes out in order; one that
/// comes later still is released at once, marked and counted. Samples of equal time keep their order.
/// [`flush`](Self::flush) hands out the rest at the end.
///
/// `storage` is an array on a computer without an allocator (`TimeOrdering::new([const { None }; 32])`), a `Vec` or boxed
/// slice elsewhere; places that are `Some` are emptied.
///
/// # Source
/// Thesis Algorithm 2.
///
/// # Deviation
/// The listing exchanges whole batches, has lost its set operations in print, never hands out its last batch and passes
/// what is late by more than a batch on in silence. One sample in, one sample out gives the same output for batches of the
/// size of the store (test `golden_batches`), at a latency that does not vary.
#[derive(Clone, Debug)]
pub struct TimeOrdering<S, B: AsMut<[Option<Held<S>>]>> {
    /// The first `len` places are a heap, the earliest at the root.
    storage: B,
    len: usize,
    arrivals: u64,
    newest_ns: Option<i64>,
    released_ns: Option<i64>,
    late: usize,
    violations: usize,
    sample: PhantomData<S>,
}

impl<S, B: AsMut<[Option<Held<S>>]>> TimeOrdering<S, B> {
    /// Nothing held yet.
    pub fn new(mut storage: B) -> Self {
        for place in storage.as_mut() {
            *place = None;
        }
        Self {
            storage,
            len: 0,
            arrivals: 0,
            newest_ns: None,
            released_ns: None,
            late: 0,
            violations: 0,
            sample: PhantomData,
        }
    }

    /// Takes a sample; hands out the earliest of all once the store is full.
    pub fn push(&mut self, time_ns: i64, sample: S) -> Option<Released<S>> {
        self.late += usize::from(self.newest_ns.is_some_and(|newest| time_ns < newest));
        self.newest_ns = self.newest_ns.max(Some(time_ns));
        let mut entry = Held { time_ns, arrival: self.arrivals, sample };
        self.arrivals += 1;
        let heap = self.storage.as_mut();
        if self.len < heap.len() {
            heap[self.len] = Some(entry);
            self.len += 1;
            rise(&mut heap[..self.len]);
            return None;
        }
        // The earliest of those held and the new one leaves.
        if let Some(root) = heap.first_mut().and_then(Option::as_mut).filter(|root| root.key() < entry.key()) {
            core::mem::swap(root, &mut entry);
            sink(heap);
        }
        Some(self.release(entry))
    }

    /// Hands out the earliest sample still held; call until `None` when no more come.
    pub fn flush(&mut self) -> Option<Released<S>> {
        let last = self.len.checked_sub(1)?;
        let heap = self.storage.as_mut();
        heap.swap(0, last);
        let entry = heap[last].take()?;
        self.len = last;
        sink(&mut heap[..last]);
        Some(self.release(entry))
    }

    fn release(&mut self, entry: Held<S>) -> Released<S> {
        let in_order = self.released_ns.is_none_or(|released| released <= entry.time_ns);
        self.violations += usize::from(!in_order);
        self.released_ns = self.released_ns.max(Some(entry.time_ns));
        Released { time_ns: entry.time_ns, sample: entry.sample, in_order }
    }

    /// Samples held.
    pub fn held(&self) -> usize {
        self.len
    }

    /// Samples that came after one of a later time.
    pub fn late(&self) -> usize {
        self.late
    }

    /// Samples that came too late to be released in order.
    pub fn violations(&self) -> usize {
        self.violations
    }
}

fn earlier<S>(a: Option<&Option<Held<S>>>, b: Option<&Option<Held<S>>>) -> bool {
    match (a, b) {
        (Some(Some(a)), Some(Some(b))) => a.key() < b.key(),
        _ => false,
    }
}

/// Moves the last entry of a heap up to its place.
fn rise<S>(heap: &mut [Option<Held<S>>]) {
    let mut child = heap.len().saturating_sub(1);
    while child > 0 {
        let parent = (child - 1) / 2;
        if !earlier(heap.get(child), heap.get(parent)) {
            break;
        }
        heap.swap(child, parent);
        child = parent;
    }
}

/// Moves the first entry of a heap down to its place.
fn sink<S>(heap: &mut [Option<Held<S>>]) {
    let mut parent = 0;
    loop {
        let (left, right) = (2 * parent + 1, 2 * parent + 2);
        let child = if earlier(heap.get(right), heap.get(left)) { right } else { left };
        if !earlier(heap.get(child), heap.get(parent)) {
            break;
        }
        heap.swap(child, parent);
        parent = child;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::spread;

    fn ordering<const N: usize>() -> TimeOrdering<usize, [Option<Held<usize>>; N]> {
        TimeOrdering::new([const { None }; N])
    }

    fn run<const N: usize>(times: &[i64]) -> (Vec<(i64, usize, bool)>, usize, usize) {
        let mut ordering = ordering::<N>();
        let mut out = Vec::new();
        for (i, &time_ns) in times.iter().enumerate() {
            out.extend(ordering.push(time_ns, i).map(|r| (r.time_ns, r.sample, r.in_order)));
            assert!(ordering.held() <= N);
        }
        while let Some(r) = ordering.flush() {
            out.push((r.time_ns, r.sample, r.in_order));
        }
        (out, ordering.late(), ordering.violations())
    }

    /// Batches of `reference/equations.md` f, Algorithm 2.
    #[test]
    fn golden_batches() {
        let mut ordering = ordering::<4>();
        let mut outputs = Vec::new();
        for batch in [[1, 3, 5, 7], [4, 6, 8, 10], [9, 11, 12, 13]] {
            outputs.push(batch.iter().filter_map(|&t| ordering.push(t, 0)).map(|r| r.time_ns).collect::<Vec<_>>());
        }
        outputs.push(core::iter::from_fn(|| ordering.flush()).map(|r| r.time_ns).collect());
        assert_eq!(outputs, [vec![], vec![1, 3, 4, 5], vec![6, 7, 8, 9], vec![10, 11, 12, 13]]);
        assert_eq!((ordering.late(), ordering.violations()), (3, 0));
    }

    #[test]
    fn every_sample_leaves_once_and_only_the_hopeless_out_of_order() {
        let mut drawn = 0;
        let mut next = |n: i64| {
            drawn += 1;
            i64::try_from(spread(drawn) >> 33).unwrap() % n
        };
        for round in 0..200 {
            let spread = 1 + round % 17;
            let times: Vec<i64> = (0..300_i64).map(|k| k + next(spread)).collect();
            let (out, _, violations) = run::<8>(&times);
            let mut seen: Vec<usize> = out.iter().map(|o| o.1).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..times.len()).collect::<Vec<_>>());
            // The definition of a violation, from the output alone.
            let mut newest = i64::MIN;
            let mut expected = 0;
            for &(time, _, in_order) in &out {
                assert_eq!(in_order, time >= newest);
                expected += usize::from(time < newest);
                newest = newest.max(time);
            }
            assert_eq!(violations, expected);
            // Stable where nothing was hopeless: the same as sorting everything.
            let overtaken = |i: usize| times[..i].iter().filter(|&&t| t > times[i]).count();
            if (0..times.len()).all(|i| overtaken(i) <= 8) {
                let mut sorted: Vec<usize> = (0..times.len()).collect();
                sorted.sort_by_key(|&i| times[i]);
                assert_eq!(out.iter().map(|o| o.1).collect::<Vec<_>>(), sorted);
                assert_eq!(violations, 0);
            }
        }
    }

    #[test]
    fn overtaken_by_one_more_than_there_are_places() {
        // The first fits, the second does not: 5 leaves when 6 to 9 fill the places.
        assert_eq!(run::<4>(&[5, 6, 7, 8, 1, 9, 10]).2, 0);
        let (out, late, violations) = run::<4>(&[5, 6, 7, 8, 9, 1, 10]);
        assert_eq!((late, violations), (1, 1));
        assert_eq!(out.iter().find(|o| !o.2).map(|o| o.0), Some(1));
        assert_eq!(out.len(), 7);
    }

    #[test]
    fn no_place_passes_on_and_equal_times_keep_their_order() {
        assert_eq!(run::<0>(&[2, 1]).0, [(2, 0, true), (1, 1, false)]);
        let (out, _, violations) = run::<3>(&[4, 4, 4, 4, 4]);
        assert_eq!(out.iter().map(|o| o.1).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_eq!(violations, 0);
    }
}
