//! How far one history is from another.

use super::history::{History, Kind};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Differences of one channel over the output times, relative to the largest reference value of the channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChannelError {
    /// Largest.
    pub peak: f64,
    /// Root mean square.
    pub rms: f64,
}

/// Why a run has no error: a gap in its curve.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Gap {
    /// Fewer output times than the reference.
    #[error("the run has {found} output times, the reference {expected}")]
    Short {
        /// Of the run.
        found: usize,
        /// Of the reference.
        expected: usize,
    },
    /// Output times that are not those of the reference.
    #[error("the run has an output time at {found} s where the reference has one at {expected} s")]
    OtherTime {
        /// Of the run.
        found: f64,
        /// Of the reference.
        expected: f64,
    },
    /// Channels that are not those of the reference.
    #[error("the run does not record the channels of the reference")]
    OtherChannels,
    /// Numbers that left the finite range.
    #[error("{channel} left finite numbers at t = {time} s")]
    NotFinite {
        /// Name of the channel.
        channel: String,
        /// s.
        time: f64,
    },
}

/// Share of the largest value of its kind below which a channel is silent: what it holds is rounding.
pub(super) const SILENT: f64 = 1e-9;

/// What each channel's errors are relative to, its largest magnitude; none for a channel in which nothing happens.
///
/// A moment counts as nothing beside moments and beside forces on arms of 1 m, a force beside forces, a stress beside stresses and beside
/// forces on areas of 1 m^2.
#[must_use]
pub fn scales(reference: &History) -> Vec<Option<f64>> {
    let largest = |values: &[f64], width: usize| values.chunks_exact(width).map(norm).fold(0.0, f64::max);
    let sizes: Vec<f64> = reference.channels.iter().zip(&reference.values).map(|(c, v)| largest(v, c.width)).collect();
    let of = |kind| reference.channels.iter().zip(&sizes).filter(|(c, _)| c.kind == kind).fold(0.0_f64, |m, (_, s)| m.max(*s));
    let (moment, force, stress) = (of(Kind::Moment), of(Kind::Force), of(Kind::Stress));
    let floor = |kind| {
        SILENT
            * match kind {
                Kind::Moment => moment.max(force),
                Kind::Force => force,
                Kind::Stress => stress.max(force),
            }
    };
    reference.channels.iter().zip(sizes).map(|(c, size)| (size > floor(c.kind)).then_some(size)).collect()
}

/// Errors of `run` channel by channel; none for channels that are silent in the reference.
///
/// # Errors
/// [`Gap`] if the two cannot be compared.
pub fn compare(reference: &History, run: &History) -> Result<Vec<Option<ChannelError>>, Gap> {
    if run.channels != reference.channels {
        return Err(Gap::OtherChannels);
    }
    if run.times.len() != reference.times.len() {
        return Err(Gap::Short { found: run.times.len(), expected: reference.times.len() });
    }
    let span = reference.times.iter().fold(0.0_f64, |m, t| m.max(t.abs()));
    if let Some((&found, &expected)) = run.times.iter().zip(&reference.times).find(|(a, b)| !same_time(**a, **b, span)) {
        return Err(Gap::OtherTime { found, expected });
    }
    let mut errors = Vec::with_capacity(run.channels.len());
    for (index, scale) in scales(reference).into_iter().enumerate() {
        let width = run.channels[index].width;
        let (mut peak, mut sum) = (0.0_f64, 0.0);
        for (row, (found, expected)) in run.values[index].chunks_exact(width).zip(reference.values[index].chunks_exact(width)).enumerate() {
            let difference = found.iter().zip(expected).map(|(f, e)| (f - e) * (f - e)).sum::<f64>().sqrt();
            let relative = difference / scale.unwrap_or(1.0);
            if !(relative * relative).is_finite() {
                return Err(Gap::NotFinite { channel: run.channels[index].name(), time: run.times[row] });
            }
            peak = peak.max(relative);
            sum += relative * relative;
        }
        let rms = (sum / run.times.len().max(1) as f64).sqrt();
        errors.push(scale.map(|_| ChannelError { peak, rms }));
    }
    Ok(errors)
}

/// Output times that mean the same.
#[must_use]
pub fn same_time(a: f64, b: f64, span: f64) -> bool {
    (a - b).abs() <= 1e-9 * span
}

/// The largest peak and the largest root mean square; none if every channel is silent.
#[must_use]
pub fn worst(errors: &[Option<ChannelError>]) -> Option<ChannelError> {
    errors.iter().flatten().copied().reduce(|a, b| ChannelError { peak: a.peak.max(b.peak), rms: a.rms.max(b.rms) })
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::history::Channel;

    /// Moment and force of one hinge at two times.
    fn history(moment: [f64; 6], force: [f64; 6]) -> History {
        let channel = |quantity, kind| Channel { group: "hinges", owner: "pin".into(), quantity, kind, width: 3 };
        History {
            channels: vec![channel("load_moment", Kind::Moment), channel("load_force", Kind::Force)],
            times: vec![0.0, 1.0],
            values: vec![moment.to_vec(), force.to_vec()],
        }
    }

    #[test]
    fn errors_are_relative_to_the_largest_reference_value_of_the_channel() {
        let reference = history([0.0, 3.0, 4.0, 0.0, 0.0, 0.0], [10.0, 0.0, 0.0, 0.0, 20.0, 0.0]);
        let run = history([0.0, 3.0, 4.0, 0.5, 0.0, 0.0], [10.0, 0.0, 0.0, 0.0, 20.0, 0.0]);
        let errors = compare(&reference, &run).unwrap();
        let moment = errors[0].unwrap();
        assert_eq!(moment.peak, 0.1);
        assert!((moment.rms - 0.1 / 2.0_f64.sqrt()).abs() < 1e-15, "{}", moment.rms);
        assert_eq!(errors[1], Some(ChannelError { peak: 0.0, rms: 0.0 }));
        assert_eq!(worst(&errors), errors[0]);
    }

    #[test]
    fn a_channel_of_rounding_is_silent() {
        let reference = history([1e-13; 6], [10.0; 6]);
        let errors = compare(&reference, &history([3e-13; 6], [10.0; 6])).unwrap();
        assert_eq!(errors[0], None);
        assert_eq!(worst(&[None, None]), None);
    }

    #[test]
    fn a_stress_is_rounding_beside_forces_on_a_square_metre() {
        let mut reference = history([0.0; 6], [10.0; 6]);
        reference.channels.push(Channel {
            group: "bodies",
            owner: "panel".into(),
            quantity: "von_mises_peak",
            kind: Kind::Stress,
            width: 1,
        });
        let largest_force = 300.0_f64.sqrt();
        for (share, counts) in [(0.5, false), (2.0, true)] {
            reference.values.truncate(2);
            reference.values.push(vec![0.0, share * SILENT * largest_force]);
            assert_eq!(scales(&reference)[2].is_some(), counts);
        }
    }

    #[test]
    fn what_cannot_be_compared_is_a_gap_with_its_reason() {
        let reference = history([1.0; 6], [1.0; 6]);
        let gap = |run: &History| compare(&reference, run).unwrap_err().to_string();
        let mut short = reference.clone();
        short.times.pop();
        assert_eq!(gap(&short), "the run has 1 output times, the reference 2");
        let mut other = reference.clone();
        other.times[1] = 1.5;
        assert_eq!(gap(&other), "the run has an output time at 1.5 s where the reference has one at 1 s");
        for bad in [f64::NAN, f64::INFINITY, 1e200] {
            let mut broken = reference.clone();
            broken.values[1][4] = bad;
            assert_eq!(gap(&broken), "pin force left finite numbers at t = 1 s");
        }
        let mut fewer = reference.clone();
        fewer.channels.pop();
        assert_eq!(gap(&fewer), "the run does not record the channels of the reference");
    }
}
