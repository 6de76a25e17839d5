//! Cells whose edges take equal time to cross at full speed.

use nalgebra::Vector3;
use num_traits::AsPrimitive;
use tumble_dynamics::AlignedBox;

/// Most cells of one grid.
const MOST_CELLS: f64 = 2_097_152.0;

/// A grid over a box, with the start at the centre of a cell. An axis on which nothing can move has one layer of no height.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Least corner of the first cell, m.
    origin: Vector3<f64>,
    /// Edges of a cell, m.
    cell: Vector3<f64>,
    counts: [usize; 3],
    edge_s: f64,
}

impl Grid {
    /// Edge at which a box has about `cells` cells, s.
    ///
    /// # Errors
    /// None; `None` where the box is not finite or nothing in it can move.
    pub(super) fn edge_for(region: &AlignedBox, speed: &Vector3<f64>, cells: f64) -> Option<f64> {
        let extents = (region.upper_world - region.lower_world).component_div(speed);
        let moving = || extents.iter().zip(speed).filter(|(extent, speed)| **extent > 0.0 && **speed > 0.0);
        let longest = moving().map(|(extent, _)| *extent).fold(0.0, f64::max);
        if !(longest > 0.0 && longest.is_finite()) {
            return None;
        }
        // Halved until there are enough: a box may be so flat that an axis has one layer for long.
        let mut edge_s = longest;
        for _ in 0..64 {
            if moving().map(|(extent, _)| (extent / edge_s).max(1.0)).product::<f64>() >= cells {
                break;
            }
            edge_s *= 0.5;
        }
        Some(edge_s)
    }

    /// The grid of this edge over `region`; `None` where it would be too large.
    pub(super) fn over(region: &AlignedBox, speed: &Vector3<f64>, start: &Vector3<f64>, edge_s: f64) -> Option<Self> {
        let mut grid = Self { origin: *start, cell: Vector3::zeros(), counts: [1; 3], edge_s };
        let mut cells = 1.0;
        for axis in 0..3 {
            let (lower, upper) = (region.lower_world[axis], region.upper_world[axis]);
            let edge_m = speed[axis] * edge_s;
            if edge_m > 0.0 && upper > lower {
                let below = ((start[axis] - lower) / edge_m - 0.5).ceil().max(0.0);
                let above = ((upper - start[axis]) / edge_m - 0.5).ceil().max(0.0);
                cells *= below + above + 1.0;
                if cells.is_nan() || cells > MOST_CELLS {
                    return None;
                }
                grid.cell[axis] = edge_m;
                grid.origin[axis] = start[axis] - (below + 0.5) * edge_m;
                let count = AsPrimitive::<usize>::as_(below + above) + 1;
                grid.counts[axis] = count;
            }
        }
        Some(grid)
    }

    pub(super) fn edge_s(&self) -> f64 {
        self.edge_s
    }

    pub(super) fn len(&self) -> usize {
        self.counts.iter().product()
    }

    pub(super) fn count(&self, axis: usize) -> usize {
        self.counts[axis]
    }

    /// Place of a cell along each axis.
    pub(super) fn place(&self, cell: usize) -> [usize; 3] {
        let [x, y, _] = self.counts;
        [cell % x, cell / x % y, cell / (x * y)]
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.counts[0] * (y + self.counts[1] * z)
    }

    /// The place that holds a position, or the nearest one.
    fn place_of(&self, position: &Vector3<f64>) -> [usize; 3] {
        std::array::from_fn(|axis| {
            if self.cell[axis] > 0.0 {
                let along = ((position[axis] - self.origin[axis]) / self.cell[axis]).floor().max(0.0);
                let place: usize = along.as_();
                place.min(self.counts[axis] - 1)
            } else {
                0
            }
        })
    }

    /// The cell that holds a position, or the nearest one.
    pub(super) fn cell_of(&self, position: &Vector3<f64>) -> usize {
        self.index(self.place_of(position))
    }

    /// Centre of a cell, m.
    pub(super) fn center(&self, cell: usize) -> Vector3<f64> {
        let place = self.place(cell);
        Vector3::from_fn(|axis, _| self.origin[axis] + (place[axis] as f64 + 0.5) * self.cell[axis])
    }

    /// Half the edges of a cell, m.
    pub(super) fn half_edges(&self) -> Vector3<f64> {
        self.cell * 0.5
    }

    /// Half the diagonal of a cell, m, rounded up.
    pub(super) fn half_diagonal_m(&self) -> f64 {
        0.5 * f64::sqrt(self.cell.norm_squared()) * (1.0 + 1e-9)
    }

    /// Least and largest coordinate of a cell along an axis, m.
    pub(super) fn span(&self, cell: usize, axis: usize) -> (f64, f64) {
        let lower = self.origin[axis] + self.place(cell)[axis] as f64 * self.cell[axis];
        (lower, lower + self.cell[axis])
    }

    /// Time at full speed from a position to the nearest face of its cell, s.
    pub(super) fn depth_s(&self, position: &Vector3<f64>) -> f64 {
        let cell = self.cell_of(position);
        let depth = |axis: usize| {
            let (lower, upper) = self.span(cell, axis);
            (position[axis] - lower).min(upper - position[axis]).max(0.0) / self.cell[axis]
        };
        (0..3).filter(|axis| self.counts[*axis] > 1).map(depth).fold(0.5, f64::min) * self.edge_s
    }

    /// Point of a cell nearest to a position, m.
    pub(super) fn nearest_point(&self, cell: usize, position: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| {
            let (lower, upper) = self.span(cell, axis);
            position[axis].max(lower).min(upper)
        })
    }

    /// Calls `visit` with each cell that has a corner, edge or face in common with `cell`.
    pub(super) fn for_neighbours<E>(
        &self,
        cell: usize,
        mut visit: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let place = self.place(cell);
        let range = |axis: usize| place[axis].saturating_sub(1)..(place[axis] + 2).min(self.counts[axis]);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let neighbour = self.index([x, y, z]);
                    if neighbour != cell {
                        visit(neighbour)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Every cell with a point no farther than `radius_m` from `center`.
    pub(super) fn touching_ball(&self, center: &Vector3<f64>, radius_m: f64) -> Vec<usize> {
        let reach = Vector3::repeat(radius_m * (1.0 + 1e-9)) + self.cell;
        let (first, last) = (self.place_of(&(center - reach)), self.place_of(&(center + reach)));
        let mut cells = Vec::new();
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let cell = self.index([x, y, z]);
                    let away = self.nearest_point(cell, center) - center;
                    let slack = 1e-9 * (radius_m + self.cell.max());
                    if f64::sqrt(away.norm_squared()) <= radius_m + slack {
                        cells.push(cell);
                    }
                }
            }
        }
        cells
    }
}
