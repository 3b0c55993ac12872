//! Which views a step compares, where it does not compare all.

/// The views of a step, counted from 0: `count` of `views`, or all where `count` is 0 or no less.
///
/// The steps take the views in turn, in an order that goes around them in strides of some 0.6 of their number. So those of
/// a step are spread over all, however the cameras are ordered, every view is compared as often, and the order depends on nothing
/// but the number of the step: a fit that is resumed takes the same views. A mean over steps, as the optimisers keep it, is a
/// mean over views after `views / count` steps.
pub fn views_of_step(step: usize, count: usize, views: usize) -> Vec<usize> {
    if count == 0 || count >= views {
        return (0..views).collect();
    }
    let stride = stride_through(views);
    // Both factors are less than `views`, which no renderer holds more than 2^32 of.
    let first = (step % views) * count % views;
    (first..first + count).map(|at| at % views * stride % views).collect()
}

/// Steps after which every view was compared at least once.
pub fn steps_of_a_turn(count: usize, views: usize) -> usize {
    if count == 0 { 1 } else { views.div_ceil(count).max(1) }
}

/// The number without a common divisor with `views` that is nearest to its golden section.
fn stride_through(views: usize) -> usize {
    let middle = (0.618_034 * views as f64).round() as usize;
    let apart = |&stride: &usize| divisor(stride, views) == 1;
    (0..views).flat_map(|off| [middle + off, middle.saturating_sub(off)]).find(apart).unwrap_or(1)
}

/// The greatest common divisor.
fn divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::{steps_of_a_turn, views_of_step};

    #[test]
    fn every_view_is_compared_as_often() {
        for (count, views) in [(1, 1), (1, 7), (3, 7), (8, 24), (5, 24), (23, 24), (7, 120)] {
            let mut times = vec![0; views];
            // After `views` steps every view had `count` turns.
            for step in 0..views {
                let of_step = views_of_step(step, count, views);
                let mut apart = of_step.clone();
                apart.sort_unstable();
                apart.dedup();
                assert!(apart.len() == count && of_step.len() == count, "{of_step:?} of {views}");
                of_step.iter().for_each(|&view| times[view] += 1);
                if step + 1 == steps_of_a_turn(count, views) {
                    assert!(times.iter().all(|&n| n > 0), "{count} of {views}: {times:?}");
                }
            }
            assert!(times.iter().all(|&n| n == count), "{count} of {views}: {times:?}");
        }
    }

    #[test]
    fn the_views_of_a_step_are_spread() {
        // With 24 cameras around an object, neighbours among the eight of a step are at most seven apart.
        for step in 0..24 {
            let mut views = views_of_step(step, 8, 24);
            views.sort_unstable();
            let gap = views.windows(2).map(|pair| pair[1] - pair[0]).chain([views[0] + 24 - views[7]]).max();
            assert!(gap <= Some(7), "{views:?}");
        }
    }

    #[test]
    fn all_views_stay_in_order() {
        for count in [0, 5, 6] {
            assert_eq!(views_of_step(3, count, 5), [0, 1, 2, 3, 4]);
        }
        assert_eq!(
            (steps_of_a_turn(0, 5), steps_of_a_turn(2, 5), steps_of_a_turn(9, 5), steps_of_a_turn(2, 0)),
            (1, 3, 1, 1)
        );
    }
}
