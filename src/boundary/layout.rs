//! Where each state of the air-and-pack model is in its vector, and which of them a disturbance enters.

/// Directions in which disturbances enter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shock {
    Jerk,
    /// A kink.
    Slope,
    /// What a kink that comes earlier by dt adds, per its size times dt: air, modes and sensor as one second of a unit
    /// slope leaves them.
    Earlier,
}

impl Shock {
    pub const COUNT: usize = 3;

    /// Where this direction's score is.
    pub fn place(self, stage: usize) -> usize {
        stage * Self::COUNT + self as usize
    }
}

/// Where each state is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub modes: usize,
    pub lagging: bool,
    pub with_rate: bool,
}

impl Layout {
    /// The sensor's deviation from the air.
    pub fn lag(&self) -> usize {
        self.modes
    }
    pub fn temperature(&self) -> usize {
        self.modes + usize::from(self.lagging)
    }
    pub fn slope(&self) -> usize {
        self.temperature() + 1
    }
    pub fn curvature(&self) -> usize {
        self.temperature() + 2
    }
    pub fn jerk(&self) -> usize {
        self.temperature() + 3
    }
    /// The rate functional at the beginning of the window.
    pub fn window_start(&self) -> usize {
        self.temperature() + 4
    }
    /// States that move by themselves.
    pub fn moving(&self) -> usize {
        self.temperature() + 4
    }
    pub fn size(&self) -> usize {
        self.moving() + usize::from(self.with_rate)
    }
}
