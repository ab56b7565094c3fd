//! Sparse matrices that make new points from old ones.

use std::ops::{Add, Mul};

/// Rows of (index, weight): new value = sum of weight * old value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stencils {
    starts: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Stencils {
    /// No rows.
    pub fn new() -> Self {
        Self { starts: vec![0], entries: Vec::new() }
    }

    /// Adds a row.
    pub fn push(&mut self, row: impl IntoIterator<Item = (u32, f32)>) {
        self.entries.extend(row);
        self.starts.push(self.entries.len() as u32);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Entries of a row.
    pub fn row(&self, i: usize) -> &[(u32, f32)] {
        &self.entries[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// Values of all rows.
    pub fn apply<T>(&self, values: &[T]) -> Vec<T>
    where
        T: Copy + Default + Add<Output = T> + Mul<f32, Output = T>,
    {
        let value = |i| self.row(i).iter().fold(T::default(), |sum, (j, w)| sum + values[*j as usize] * *w);
        (0..self.len()).map(value).collect()
    }
}
