//! Compared signals of a replay.

/// One compared signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[allow(missing_docs)]
pub enum Channel {
    YawRate,
    Ay,
    Vy,
    Roll,
    Steer,
    Ax,
    /// Longitudinal velocity, leaking to the log's.
    Vx,
    /// Heading, leaking to the log's.
    Yaw,
    /// Place along and across the heading, leaking to the log's.
    Along,
    Across,
    Articulation,
    ArticulationRate,
}

/// All of them.
pub const CHANNELS: [Channel; 12] = [
    Channel::YawRate,
    Channel::Ay,
    Channel::Vy,
    Channel::Roll,
    Channel::Steer,
    Channel::Ax,
    Channel::Vx,
    Channel::Yaw,
    Channel::Along,
    Channel::Across,
    Channel::Articulation,
    Channel::ArticulationRate,
];

impl Channel {
    /// Its name in reports: the signal's, or the compared component of a place.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::YawRate => "yaw_rate",
            Self::Ay => "ay",
            Self::Vy => "vy",
            Self::Roll => "roll",
            Self::Steer => "steer",
            Self::Ax => "ax",
            Self::Vx => "vx",
            Self::Yaw => "yaw",
            Self::Along => "along",
            Self::Across => "across",
            Self::Articulation => "articulation",
            Self::ArticulationRate => "articulation_rate",
        }
    }

    /// Columns of a log that it needs.
    #[must_use]
    pub fn needs(self) -> &'static [&'static str] {
        match self {
            Self::YawRate => &["yaw_rate"],
            Self::Ay => &["ay"],
            Self::Vy => &["vy"],
            Self::Roll => &["roll"],
            Self::Steer => &["steer"],
            Self::Ax => &["ax", "accel_cmd"],
            Self::Vx => &["vx", "accel_cmd"],
            Self::Yaw => &["yaw"],
            Self::Along | Self::Across => &["x", "y", "yaw"],
            Self::Articulation => &["articulation"],
            Self::ArticulationRate => &["articulation_rate"],
        }
    }

    /// True if the replay leaks to the log, so that the compared value is the difference itself.
    #[must_use]
    pub fn leaks(self) -> bool {
        matches!(self, Self::Vx | Self::Yaw | Self::Along | Self::Across)
    }

    /// True if a satellite receiver or a navigation unit measures it: place, heading, velocity.
    #[must_use]
    pub fn by_receiver(self) -> bool {
        matches!(self, Self::Vx | Self::Vy | Self::Yaw | Self::Along | Self::Across)
    }

    /// True if the full plant's neutral replay corrects it.
    #[must_use]
    pub fn corrected(self) -> bool {
        matches!(
            self,
            Self::YawRate
                | Self::Ax
                | Self::Ay
                | Self::Vy
                | Self::Roll
                | Self::Articulation
                | Self::ArticulationRate
        )
    }

    /// Floor of the noise of one sample, in the signal's unit: rounding of ordinary logs.
    #[must_use]
    pub fn least_noise(self) -> f64 {
        match self {
            Self::YawRate | Self::ArticulationRate => 2e-4,
            Self::Ay | Self::Ax => 5e-3,
            Self::Vy | Self::Vx => 2e-3,
            Self::Roll | Self::Articulation | Self::Yaw => 1e-4,
            Self::Steer => 1e-5,
            Self::Along | Self::Across => 2e-3,
        }
    }
}
