//! Which reel holds which run of the unwound fibre.

/// A supply reel's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum ReelName {
    /// Holds the run with end A.
    A,
    /// Holds the run with end B.
    B,
    /// Holds a run that is held at both its ends; counted from 1.
    Captive(usize),
}

impl std::fmt::Display for ReelName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ReelName::A => f.pad("A"),
            ReelName::B => f.pad("B"),
            ReelName::Captive(number) => f.pad(&format!("C{number}")),
        }
    }
}

/// A supply reel and the fibre that it holds when it comes into use.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Reel {
    pub(crate) name: ReelName,
    pub(crate) captive: bool,
    /// Loaded before this step; counted from 1.
    pub(crate) prepared_before_step: usize,
    /// The reel from which its fibre was spooled over; none for the fibre's first reels.
    pub(crate) taken_from: Option<ReelName>,
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
}

/// With which end a segment begins, by arclength.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SegmentStart {
    Low,
    High,
}

/// A run of unwound pieces on its reel; pieces count from 1 in the order of arclength.
#[derive(Debug, Clone, Copy)]
struct Run {
    first: usize,
    last: usize,
    reel: usize,
}

#[derive(Debug)]
pub(super) struct Reels<'a> {
    ends_m: &'a [f64],
    list: Vec<Reel>,
    drawn_m: Vec<f64>,
    runs: Vec<Run>,
}

impl<'a> Reels<'a> {
    /// The fibre before winding: on one reel if its own end is wound first, else on two that part where layer 1 begins. `first` is
    /// the piece that is wound first.
    pub(super) fn new(first: usize, start: SegmentStart, ends_m: &'a [f64]) -> Self {
        let count = ends_m.len() - 1;
        let mut reels = Self { ends_m, list: Vec::new(), drawn_m: Vec::new(), runs: Vec::new() };
        // Up to which piece reel A holds the fibre.
        let split = match start {
            SegmentStart::Low => first - 1,
            SegmentStart::High => first,
        };
        for (name, from, to) in [(ReelName::A, 1, split), (ReelName::B, split + 1, count)] {
            if from <= to {
                // One reel for the whole fibre is named after the end that is wound first.
                let name =
                    if to - from + 1 == count { if first == 1 { ReelName::A } else { ReelName::B } } else { name };
                let reel = reels.prepare(name, 1, None, from, to);
                reels.runs.push(Run { first: from, last: to, reel });
            }
        }
        reels
    }

    fn prepare(
        &mut self,
        name: ReelName,
        step: usize,
        taken_from: Option<ReelName>,
        first: usize,
        last: usize,
    ) -> usize {
        self.list.push(Reel {
            name,
            captive: matches!(name, ReelName::Captive(_)),
            prepared_before_step: step,
            taken_from,
            from_m: self.ends_m[first - 1],
            to_m: self.ends_m[last],
        });
        self.drawn_m.push(0.0);
        self.list.len() - 1
    }

    fn prepare_captive(&mut self, step: usize, from: usize, first: usize, last: usize) -> usize {
        let number = self.list.iter().filter(|r| r.captive).count() + 1;
        let taken_from = Some(self.list[from].name);
        self.prepare(ReelName::Captive(number), step, taken_from, first, last)
    }

    /// Takes a piece off its reel, spooling over first what this makes captive. The reel, and what it has given so far.
    pub(super) fn wind(&mut self, step: usize, segment: usize, start: SegmentStart) -> (ReelName, f64) {
        let at =
            self.runs.iter().position(|r| r.first <= segment && segment <= r.last).expect("each segment is wound once");
        let run = self.runs.remove(at);
        let count = self.ends_m.len() - 1;
        // The side that feeds the layer includes it; the other side is left behind its starting end.
        let (feed, left) = match start {
            SegmentStart::Low => ((segment, run.last), (run.first, segment - 1)),
            SegmentStart::High => ((run.first, segment), (segment + 1, run.last)),
        };
        let was_captive = self.list[run.reel].captive;
        let begins_inside_or_at_own_end = match start {
            SegmentStart::Low => step > 1 && segment == run.first && run.first == 1,
            SegmentStart::High => step > 1 && segment == run.last && run.last == count,
        };
        let feed_is_held = match start {
            SegmentStart::Low => feed.1 < count,
            SegmentStart::High => feed.0 > 1,
        };
        let splits = left.0 <= left.1;
        let mut feed_reel = run.reel;
        if !was_captive && feed_is_held && (splits && step > 1 || begins_inside_or_at_own_end) {
            feed_reel = self.prepare_captive(step, run.reel, feed.0, feed.1);
        }
        if splits {
            let left_is_held = left.0 > 1 && left.1 < count;
            let reel = if left_is_held { self.prepare_captive(step, run.reel, left.0, left.1) } else { run.reel };
            self.runs.push(Run { first: left.0, last: left.1, reel });
        }
        let rest = match start {
            SegmentStart::Low => (segment + 1, run.last),
            SegmentStart::High => (run.first, segment - 1),
        };
        if rest.0 <= rest.1 {
            self.runs.push(Run { first: rest.0, last: rest.1, reel: feed_reel });
        }
        self.drawn_m[feed_reel] += self.ends_m[segment] - self.ends_m[segment - 1];
        (self.list[feed_reel].name, self.drawn_m[feed_reel])
    }

    pub(super) fn into_list(self) -> Vec<Reel> {
        self.list
    }
}
