//! Nearest neighbours (J. L. Bentley's k-d tree, 1975).

/// Keys sorted so that the middle of each range splits it along its widest axis.
pub(super) struct Tree<const D: usize> {
    keys: Vec<[f32; D]>,
    /// Index of each key in the list that the tree was made of.
    source: Vec<u32>,
    axes: Vec<u8>,
}

/// Keys in a range that is searched one by one.
const LEAF: usize = 8;

impl<const D: usize> Tree<D> {
    pub(super) fn new(keys: &[[f32; D]]) -> Self {
        let mut source: Vec<u32> = (0..keys.len() as u32).collect();
        let mut axes = vec![0; keys.len()];
        sort(keys, &mut source, &mut axes);
        Self { keys: source.iter().map(|i| keys[*i as usize]).collect(), source, axes }
    }

    /// The nearest key within a distance, and the square of its distance.
    pub(super) fn nearest(&self, query: &[f32; D], within: f32) -> Option<(usize, f32)> {
        let mut best = (usize::MAX, within * within);
        self.search(query, 0, self.keys.len(), &mut best);
        (best.0 != usize::MAX).then(|| (self.source[best.0] as usize, best.1))
    }

    fn search(&self, query: &[f32; D], start: usize, end: usize, best: &mut (usize, f32)) {
        if end - start <= LEAF {
            (start..end).for_each(|i| self.compare(query, i, best));
            return;
        }
        let middle = start.midpoint(end);
        self.compare(query, middle, best);
        let axis = self.axes[middle] as usize;
        let away = query[axis] - self.keys[middle][axis];
        let (near, far) = if away < 0.0 {
            ((start, middle), (middle + 1, end))
        } else {
            ((middle + 1, end), (start, middle))
        };
        self.search(query, near.0, near.1, best);
        if away * away < best.1 {
            self.search(query, far.0, far.1, best);
        }
    }

    fn compare(&self, query: &[f32; D], index: usize, best: &mut (usize, f32)) {
        let distance2: f32 = query.iter().zip(&self.keys[index]).map(|(a, b)| (a - b) * (a - b)).sum();
        if distance2 < best.1 {
            *best = (index, distance2);
        }
    }
}

fn sort<const D: usize>(keys: &[[f32; D]], order: &mut [u32], axes: &mut [u8]) {
    if order.len() <= LEAF {
        return;
    }
    let extent = |axis: usize| {
        let (low, high) = order.iter().fold((f32::MAX, f32::MIN), |(low, high), i| {
            (low.min(keys[*i as usize][axis]), high.max(keys[*i as usize][axis]))
        });
        high - low
    };
    let axis = (0..D).max_by(|a, b| extent(*a).total_cmp(&extent(*b))).unwrap_or(0);
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |a, b| {
        keys[*a as usize][axis].total_cmp(&keys[*b as usize][axis]).then(a.cmp(b))
    });
    axes[middle] = axis as u8;
    sort(keys, &mut order[..middle], &mut axes[..middle]);
    sort(keys, &mut order[middle + 1..], &mut axes[middle + 1..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_a_full_search_finds() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut key = || [0; 4].map(|_| random.f32());
        let keys: Vec<[f32; 4]> = (0..500).map(|_| key()).collect();
        let tree = Tree::new(&keys);
        for _ in 0..200 {
            let query = key();
            let distance = |k: &[f32; 4]| query.iter().zip(k).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
            let expected = keys.iter().map(distance).fold(f32::MAX, f32::min);
            let (index, found) = tree.nearest(&query, 2.0).unwrap();
            assert!(found == expected && distance(&keys[index]) == expected);
        }
        assert!(tree.nearest(&[9.0; 4], 1.0).is_none());
        assert!(Tree::<2>::new(&[]).nearest(&[0.0; 2], 1.0).is_none());
    }
}
