//! The made-up scenarios with sensors that pool their signals.
use quietpath_core::scenario::{Betrayal, Detection, Pooling};

use crate::made_up::Made;

/// The scenario without betrayal, three of four sensors with energy detectors, in four ways of pooling.
pub fn pooled<const DIM: usize>(made: &Made<DIM>) -> [Made<DIM>; 4] {
    [
        ([2, 31, 400], Pooling::Uncorrelated { log_threshold: 1.5 }),
        ([40, 40, 40], Pooling::Correlated { log_threshold: 1.5, correlation: 0.7 }),
        ([3, 3, 3], Pooling::Correlated { log_threshold: -0.2, correlation: 0.2 }),
        ([20, 20, 20], Pooling::Correlated { log_threshold: 0.5, correlation: 1.0 }),
    ]
    .map(|(samples, pooling)| {
        let mut made = made.clone();
        made.pooling = pooling;
        for jammer in made.agents.iter_mut().filter_map(|agent| agent.jammer.as_mut()) {
            jammer.betrayal = Betrayal::None;
        }
        for (index, sensor) in made.sensors.iter_mut().enumerate() {
            let energy = Detection::Energy {
                samples: samples[index % 3],
                signal: 0.4 + 0.3 * index as f64,
                noise: 0.5,
                log_threshold: 0.0,
                path_loss: 1.0 + 0.2 * (index % 3) as f64,
            };
            let proxy = Detection::Proxy { scale: 0.1, epsilon: 0.3, path_loss: 2.0 };
            sensor.detection = Some(if index % 4 == 3 { proxy } else { energy });
        }
        made
    })
}
