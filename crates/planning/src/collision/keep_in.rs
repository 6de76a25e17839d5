//! Where a body may not be, when it must stay inside a union of boxes.

use nalgebra::Vector3;
use tumble_dynamics::AlignedBox;

/// A gap between two keep-in boxes that is thinner than this is rounding of their coordinates and no wall, m.
pub const KEEP_IN_GAP_M: f64 = 1e-6;

/// Everything outside the union of `keep_in` as few boxes, whose outer sides are infinite: a body inside the union is a
/// body that touches none of them, also where it straddles keep-in boxes that meet.
///
/// The boxes returned may overlap each other; together they cover exactly the closure of the complement, but for gaps
/// thinner than [`KEEP_IN_GAP_M`] between two boxes, which count as inside. Nothing is forbidden where `keep_in` is empty.
///
/// Time and memory grow with the cube of the number of different coordinates: seconds at a hundred boxes.
pub fn keep_in_complement(keep_in: &[AlignedBox]) -> Vec<AlignedBox> {
    if keep_in.is_empty() {
        return Vec::new();
    }
    let mut grid = Grid::new(keep_in);
    grid.fill_gaps();
    grid.cover()
}

/// The cells between all coordinates of the boxes.
struct Grid {
    /// Cell `i` of an axis spans `lines[i]..lines[i + 1]`; the first and last lines are infinite.
    lines: [Vec<f64>; 3],
    cells: [usize; 3],
    /// Whether a cell is in the union; the last axis runs fastest.
    inside: Vec<bool>,
}

/// A block of cells: first and one past the last, per axis.
#[derive(Clone, Copy, PartialEq)]
struct Block {
    first: [usize; 3],
    end: [usize; 3],
}

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

impl Block {
    fn cells(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let Self { first, end } = *self;
        (first[0]..end[0])
            .flat_map(move |x| (first[1]..end[1]).flat_map(move |y| (first[2]..end[2]).map(move |z| [x, y, z])))
    }
}

impl Grid {
    fn new(boxes: &[AlignedBox]) -> Self {
        let lines: [Vec<f64>; 3] = core::array::from_fn(|axis| {
            let sides = boxes.iter().flat_map(|b| [b.lower_world[axis], b.upper_world[axis]]);
            let mut lines: Vec<f64> = sides.chain([f64::NEG_INFINITY, f64::INFINITY]).collect();
            lines.sort_by(f64::total_cmp);
            lines.dedup();
            lines
        });
        let cells = [0, 1, 2].map(|axis: usize| lines[axis].len() - 1);
        let mut grid = Self { lines, cells, inside: vec![false; cells.iter().product()] };
        for b in boxes {
            let line = |axis: usize, value: f64| grid.lines[axis].partition_point(|line| *line < value);
            let block = Block {
                first: [0, 1, 2].map(|axis| line(axis, b.lower_world[axis])),
                end: [0, 1, 2].map(|axis| line(axis, b.upper_world[axis])),
            };
            for cell in block.cells() {
                let index = grid.index(cell);
                grid.inside[index] = true;
            }
        }
        grid
    }

    fn index(&self, cell: [usize; 3]) -> usize {
        (cell[0] * self.cells[1] + cell[1]) * self.cells[2] + cell[2]
    }

    fn all(&self) -> Block {
        Block { first: [0; 3], end: self.cells }
    }

    /// Counts thin gaps between two cells of the union as inside, axis by axis.
    fn fill_gaps(&mut self) {
        for axis in 0..3 {
            let mut ends = self.all();
            ends.end[axis] = 1;
            for cell in ends.cells() {
                let mut last_inside = None;
                for position in 0..self.cells[axis] {
                    let mut here = cell;
                    here[axis] = position;
                    if !self.inside[self.index(here)] {
                        continue;
                    }
                    if let Some(last) = last_inside {
                        let gap_m = self.lines[axis][position] - self.lines[axis][last + 1];
                        if gap_m < KEEP_IN_GAP_M {
                            for between in last + 1..position {
                                here[axis] = between;
                                let index = self.index(here);
                                self.inside[index] = true;
                            }
                        }
                    }
                    last_inside = Some(position);
                }
            }
        }
    }

    /// Blocks that hold all cells outside and no other, each as large as it can be.
    fn cover(&self) -> Vec<AlignedBox> {
        let sums = self.sums();
        let mut covered = self.inside.iter().map(|inside| u32::from(*inside)).collect::<Vec<_>>();
        let mut blocks = Vec::new();
        for cell in self.all().cells() {
            if covered[self.index(cell)] > 0 {
                continue;
            }
            let gain = |block: &Block| block.cells().filter(|cell| covered[self.index(*cell)] == 0).count();
            let mut best: Option<(usize, Block)> = None;
            for order in ORDERS {
                let block = self.grown(cell, order, &sums);
                let gain = gain(&block);
                if best.is_none_or(|(most, _)| gain > most) {
                    best = Some((gain, block));
                }
            }
            if let Some((_, block)) = best {
                for cell in block.cells() {
                    covered[self.index(cell)] += 1;
                }
                blocks.push(block);
            }
        }
        blocks.retain(|block| {
            let needless = block.cells().all(|cell| covered[self.index(cell)] > 1);
            if needless {
                for cell in block.cells() {
                    covered[self.index(cell)] -= 1;
                }
            }
            !needless
        });
        blocks.iter().map(|block| self.box_of(block)).collect()
    }

    /// The block around a cell outside, extended as far as it stays outside along one axis after the other.
    fn grown(&self, cell: [usize; 3], order: [usize; 3], sums: &[usize]) -> Block {
        let mut block = Block { first: cell, end: cell.map(|position| position + 1) };
        for axis in order {
            loop {
                let mut wider = block;
                if block.first[axis] > 0 {
                    wider.first[axis] -= 1;
                }
                if wider == block || self.count_inside(&wider, sums) > 0 {
                    break;
                }
                block = wider;
            }
            loop {
                let mut wider = block;
                if block.end[axis] < self.cells[axis] {
                    wider.end[axis] += 1;
                }
                if wider == block || self.count_inside(&wider, sums) > 0 {
                    break;
                }
                block = wider;
            }
        }
        block
    }

    /// How many cells of the union precede each corner in all axes.
    fn sums(&self) -> Vec<usize> {
        let [nx, ny, nz] = self.cells.map(|count| count + 1);
        let mut sums = vec![0; nx * ny * nz];
        let at = |x: usize, y: usize, z: usize| (x * ny + y) * nz + z;
        for x in 1..nx {
            for y in 1..ny {
                let mut row = 0;
                for z in 1..nz {
                    row += usize::from(self.inside[self.index([x - 1, y - 1, z - 1])]);
                    sums[at(x, y, z)] = row + sums[at(x - 1, y, z)] + sums[at(x, y - 1, z)] - sums[at(x - 1, y - 1, z)];
                }
            }
        }
        sums
    }

    fn count_inside(&self, block: &Block, sums: &[usize]) -> usize {
        let [_, ny, nz] = self.cells.map(|count| count + 1);
        let at = |x: usize, y: usize, z: usize| sums[(x * ny + y) * nz + z];
        let Block { first: [a, b, c], end: [x, y, z] } = *block;
        at(x, y, z) + at(a, b, z) + at(a, y, c) + at(x, b, c) - at(a, y, z) - at(x, b, z) - at(x, y, c) - at(a, b, c)
    }

    fn box_of(&self, block: &Block) -> AlignedBox {
        let corner = |position: [usize; 3]| Vector3::from_fn(|axis, _| self.lines[axis][position[axis]]);
        AlignedBox { lower_world: corner(block.first), upper_world: corner(block.end) }
    }
}
