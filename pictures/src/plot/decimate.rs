//! Thins long series for drawing. Extremes are kept, so a spike of one sample is still in the picture.

/// Chooses about `limit` points of a curve to draw, in increasing order, always including the first and the
/// last. The curve is given by its `channels` (equally long; x and y of a path, or only the values of a time
/// series). It is cut into pieces of equal length. Each piece keeps its first point, its last, and in each
/// channel the least and the greatest value. It also keeps its first point that is not finite, which breaks
/// the line.
pub fn decimate(channels: &[&[f64]], limit: usize) -> Vec<usize> {
    let length = channels.iter().map(|c| c.len()).min().unwrap_or(0);
    if length <= limit.max(2) {
        return (0..length).collect();
    }
    let per_run = 2 + 2 * channels.len();
    let runs = (limit / per_run).max(1);
    let mut kept = Vec::with_capacity(runs * per_run);
    for run in 0..runs {
        let (from, to) = (run * length / runs, (run + 1) * length / runs);
        if from == to {
            continue;
        }
        kept.push(from);
        kept.push(to - 1);
        for channel in channels {
            let finite = || (from..to).filter(|&i| channel[i].is_finite());
            kept.extend(finite().min_by(|&a, &b| channel[a].total_cmp(&channel[b])));
            kept.extend(finite().max_by(|&a, &b| channel[a].total_cmp(&channel[b])));
            kept.extend((from..to).find(|&i| !channel[i].is_finite()));
        }
    }
    kept.sort_unstable();
    kept.dedup();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_series_stay_whole() {
        assert_eq!(decimate(&[&[1.0, 2.0, 3.0]], 2000), [0, 1, 2]);
        assert_eq!(decimate(&[&[]], 2000), [0_usize; 0]);
    }

    #[test]
    fn spikes_ends_and_gaps_survive() {
        let mut values: Vec<f64> = (0..100_000).map(|i| (f64::from(i) * 1e-3).sin()).collect();
        values[12_345] = 1e4;
        values[54_321] = -1e4;
        values[77_777] = f64::NAN;
        let kept = decimate(&[&values], 2000);
        assert!(kept.len() <= 2001, "{}", kept.len());
        for index in [0, 12_345, 54_321, 77_777, 99_999] {
            assert!(kept.contains(&index), "{index}");
        }
        assert!(kept.is_sorted());
    }

    #[test]
    fn both_channels_of_a_path_keep_their_extremes() {
        let x: Vec<f64> = (0..50_000).map(|i| (f64::from(i) * 1e-3).cos()).collect();
        let mut y: Vec<f64> = (0..50_000).map(|i| (f64::from(i) * 1e-3).sin()).collect();
        y[333] = 9.0;
        let kept = decimate(&[&x, &y], 600);
        assert!(kept.contains(&333));
        assert!(kept.len() <= 600);
    }
}
