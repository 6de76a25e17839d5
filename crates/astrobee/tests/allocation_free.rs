//! Hot paths allocate nothing: every one of them is called a hundred thousand times under an allocator that counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![allow(
    unsafe_code,
    reason = "an allocator that counts has to implement `GlobalAlloc`; it hands everything to the system's"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use nalgebra::Vector3;
use tumble_astrobee::propulsion::{ForceAllocation, ImpellerMode, PositivityShift, QuantizedAllocation};
use tumble_dynamics::Actuation as _;
use tumble_dynamics::strategies::{draws, wrenches};

const CALLS: usize = 100_000;
const INPUTS: usize = 64;

struct Counting;

thread_local! {
    // Of this thread only, so that what the test harness does beside it does not count.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: both calls go to the system's allocator unchanged. `realloc` and `alloc_zeroed` are provided in terms of them.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// How often the calls after the first round allocate.
fn allocations<T>(mut call: impl FnMut(usize) -> T) -> usize {
    (0..INPUTS).for_each(|i| drop(black_box(call(i))));
    let before = ALLOCATIONS.with(Cell::get);
    (0..CALLS).for_each(|i| drop(black_box(call(i % INPUTS))));
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|i| vec![i]), CALLS);
}

#[test]
fn force_allocation_and_its_inverse() {
    let wanted = draws(&wrenches(0.1, 1.0), 1, INPUTS);
    for mode in ImpellerMode::ALL {
        for shift in [PositivityShift::AxisGroups, PositivityShift::Thesis] {
            let allocation = ForceAllocation { shift, ..ForceAllocation::new(mode, Vector3::new(0.01, 0.02, 0.03)) };
            let quantized = QuantizedAllocation(allocation);
            assert_eq!(allocations(|i| allocation.realize(&allocation.allocate(&wanted[i]).unwrap())), 0);
            assert_eq!(allocations(|i| quantized.realize(&quantized.allocate(&wanted[i]).unwrap())), 0);
        }
    }
}
