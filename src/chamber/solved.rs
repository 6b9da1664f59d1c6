//! Heat paths of a chamber that are solved already: a fit asks for the same ones again and again, because few of its numbers are of the
//! heat path.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use super::series::Series;
use crate::thermal::reduced::Reduced;
use crate::thermal::{Extent, HeatPath, Location, ThermalError};

/// So many of the last ones are kept: those of a fit's derivatives, and of a few fits side by side.
const MOST: usize = 32;

/// The last heat paths that were asked for, that of the last question at the end; copies of a chamber share them.
#[derive(Debug, Clone, Default)]
pub(super) struct Solved(Arc<Mutex<VecDeque<Kept>>>);

#[derive(Debug)]
struct Kept {
    asked: AskedPath,
    reduced: Arc<Reduced>,
}

#[derive(Debug, PartialEq)]
struct AskedPath {
    path: HeatPath,
    part: Option<Location>,
    modes: usize,
    shortest_s: f64,
    longest_s: f64,
}

impl Solved {
    /// A heat path as a few states, with the temperature of a part, for the times of a record.
    ///
    /// # Errors
    /// As [`Reduced::new`].
    pub(super) fn reduced(
        &self,
        path: HeatPath,
        part: Option<Location>,
        modes: usize,
        series: &Series,
    ) -> Result<Arc<Reduced>, ThermalError> {
        // Only a half space is fitted to the times of a record: a pack is the same in all.
        let (shortest_s, longest_s) = match path.extent {
            Extent::HalfSpace => (series.shortest_s(), series.duration_s.max(1.0)),
            Extent::Pack => (0.0, 0.0),
        };
        let asked = AskedPath { path, part, modes, shortest_s, longest_s };
        if let Some(reduced) = self.found(&asked) {
            return Ok(reduced);
        }
        let reduced = Arc::new(Reduced::new(&asked.path, part, modes, shortest_s, longest_s)?);
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push_back(Kept { asked, reduced: reduced.clone() });
        if kept.len() > MOST {
            kept.pop_front();
        }
        Ok(reduced)
    }

    fn found(&self, asked: &AskedPath) -> Option<Arc<Reduced>> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().rposition(|k| k.asked == *asked)?;
        let found = kept.remove(place)?;
        let reduced = found.reduced.clone();
        kept.push_back(found);
        Some(reduced)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Chamber;
    use super::super::dense::tests::model;
    use super::super::kinks::tests::kinked;
    use super::super::system::driven_by_air;
    use super::*;
    use crate::pattern::classic::Classic;

    #[test]
    fn a_heat_path_is_solved_once_and_one_behind_another_film_is_another_one() {
        let model = model(Vec::new());
        let record = kinked(&model, &Classic::Zyl.pattern(8).unwrap());
        let series = Chamber::new(&model, &[&record]).unwrap().observed[0].series.clone();
        let behind = |film| driven_by_air(&model.heat_path().unwrap(), film).0;
        let solved = Solved::default();
        let first = solved.reduced(behind(25.0), None, 6, &series).unwrap();
        let other = solved.clone().reduced(behind(26.0), None, 6, &series).unwrap();
        assert!(Arc::ptr_eq(&first, &solved.reduced(behind(25.0), None, 6, &series).unwrap()));
        assert!(Arc::ptr_eq(&other, &solved.reduced(behind(26.0), None, 6, &series).unwrap()));
        assert_ne!(first.decay_per_s, other.decay_per_s);
        // What was not asked for lately is forgotten.
        (0..MOST).for_each(|k| drop(solved.reduced(behind(30.0 + k as f64), None, 6, &series)));
        assert!(!Arc::ptr_eq(&first, &solved.reduced(behind(25.0), None, 6, &series).unwrap()));
    }
}
