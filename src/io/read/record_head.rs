//! Where the head of a record is: the row of its columns' names, which a logger may put below lines of its own and above a row of units.
//!
//! A head is a row that names the columns of a record. It is sought no further than the first row of numbers, so that nothing that was
//! measured is taken for a note. Where no row is one, the faults are those of the likeliest.

use std::io::{self, BufRead};

use super::csv_rows::{CsvPiece, CsvRows, is_aside};
use super::record_columns::{Division, RecordFormat, are_numbers, read_header, states_units};

/// A head is not sought further down.
const MOST_LINES_ABOVE: usize = 200;

/// Where the columns' names stand, and what stands around them.
#[derive(Debug)]
pub(crate) struct Head {
    pub(crate) piece: CsvPiece,
    pub(crate) division: Division,
    /// Of each column, as the row below the names states it; empty where there is no such row.
    pub(crate) units: Vec<String>,
    /// Lines above the names that are neither comments nor empty.
    notes: usize,
    line: u64,
}

impl Head {
    /// What was taken for what, in words.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let mut said = Vec::new();
        let line = self.line;
        match self.notes {
            0 => {}
            1 => said.push(format!("the head is line {line}; the line of text above it is a note")),
            notes => said.push(format!("the head is line {line}; the {notes} lines of text above it are notes")),
        }
        if !self.units.is_empty() {
            said.push(format!("line {} states units", line + 1));
        }
        said
    }
}

/// A line as the only row of a text.
struct Candidate {
    place: usize,
    division: Division,
    cells: Vec<String>,
}

impl Candidate {
    /// None of what is no row.
    fn of(line: &[u8], place: usize) -> Option<Self> {
        let mut rows = CsvRows::new(line);
        let (piece, division) = rows.header(|_| {}).ok()??;
        (piece == CsvPiece::Row).then(|| Self { place, division, cells: rows.names().map(str::to_owned).collect() })
    }

    fn cells(&self) -> Vec<&str> {
        self.cells.iter().map(String::as_str).collect()
    }

    fn is_head(&self, units: &[String], format: &RecordFormat) -> bool {
        read_header(&self.cells(), units, format, self.division).is_ok()
    }

    fn has_units_in(&self, below: &Candidate, format: &RecordFormat) -> bool {
        below.division == self.division && states_units(&self.cells(), &below.cells(), format, self.division)
    }
}

impl<R: BufRead> CsvRows<R> {
    /// Reads the head of a record; `aside` gets the lines above it. The row of units, where there is one, is read by
    /// [`CsvRows::units_row`]. None where there is no row at all.
    ///
    /// # Errors
    /// An input that fails.
    pub(crate) fn record_head(
        &mut self,
        format: &RecordFormat,
        mut aside: impl FnMut(&str),
    ) -> io::Result<Option<Head>> {
        if self.numbers_rows() {
            let found = self.header(aside)?;
            return Ok(found.map(|(piece, division)| Head { piece, division, units: Vec::new(), notes: 0, line: 1 }));
        }
        let (above, units) = self.seek_head(format)?;
        let mut notes = 0;
        for _ in 0..above {
            let Some(line) = self.next_line()? else { break };
            self.begin_piece();
            self.take(&line);
            let text = String::from_utf8_lossy(&line.bytes);
            let text = text.trim_start_matches('\u{feff}').trim_end_matches(['\r', '\n']);
            notes += usize::from(!is_aside(text));
            aside(text);
        }
        let Some((piece, division)) = self.header(aside)? else { return Ok(None) };
        Ok(Some(Head { piece, division, units, notes, line: self.line() }))
    }

    /// Reads the row of units below a head that has one.
    ///
    /// # Errors
    /// An input that fails.
    pub(crate) fn units_row(&mut self, head: &Head) -> io::Result<bool> {
        Ok(!head.units.is_empty() && self.next()?.is_some())
    }

    /// How many lines stand above the head, and the cells of a row of units below it; everything is still to be read.
    fn seek_head(&mut self, format: &RecordFormat) -> io::Result<(usize, Vec<String>)> {
        let mut lines = Vec::new();
        let mut candidates: Vec<Candidate> = Vec::new();
        let mut found = None;
        while lines.len() < MOST_LINES_ABOVE {
            let Some(line) = self.next_line()? else { break };
            let (is_whole, place) = (line.is_whole, lines.len());
            let is_nothing = is_aside(String::from_utf8_lossy(&line.bytes).trim_start_matches('\u{feff}'));
            let candidate = Candidate::of(&line.bytes, place).filter(|_| is_whole && !is_nothing);
            lines.push(line);
            let Some(candidate) = candidate else {
                // A head of several lines, or none.
                if is_nothing || !candidates.is_empty() { continue } else { break }
            };
            let above = candidates.last().filter(|above| above.place + 1 == place);
            if let Some(above) = above
                && above.has_units_in(&candidate, format)
                && (above.is_head(&[], format) || above.is_head(&candidate.cells, format))
            {
                found = Some((above.place, candidate.cells));
                break;
            }
            // One row below a head says whether it is of units.
            if let Some(head) = candidates.last().filter(|above| above.is_head(&[], format)) {
                found = Some((head.place, Vec::new()));
                break;
            }
            if are_numbers(&candidate.cells(), candidate.division) {
                let is_named =
                    |c: &&Candidate| c.cells.len() == candidate.cells.len() && c.cells.iter().all(|n| !n.is_empty());
                found = candidates.iter().position(|c| is_named(&c)).map(|named| {
                    let head = &candidates[named];
                    let below = candidates.get(named + 1).filter(|row| row.place == head.place + 1);
                    let units = below.filter(|row| head.has_units_in(row, format)).map(|row| row.cells.clone());
                    (head.place, units.unwrap_or_default())
                });
                break;
            }
            candidates.push(candidate);
        }
        let last = || candidates.last().filter(|c| c.is_head(&[], format)).map(|c| (c.place, Vec::new()));
        let first = || candidates.first().map_or((0, Vec::new()), |c| (c.place, Vec::new()));
        let found = found.or_else(last).unwrap_or_else(first);
        self.put_back(lines);
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read::record_file::{ReadRecord, parse_record_as};

    const PLAIN: &str = "time_s,temperature_c,rate_deg_per_h\n0,20,3.6\n60,21.5,7.2\n180,25,-3.6\n";

    fn read(mapping: &str, text: &str) -> Result<ReadRecord, String> {
        let mut format = RecordFormat::default();
        format.map_all(mapping).unwrap();
        parse_record_as("x", text, &format)
            .map_err(|faults| faults.faults.iter().map(|f| f.message.clone()).collect::<Vec<_>>().join("\n"))
    }

    fn same_as_plain(mapping: &str, text: &str) -> String {
        let plain = read("", PLAIN).unwrap().record;
        let found = read(mapping, text).unwrap_or_else(|said| panic!("{text}: {said}"));
        let record = &found.record;
        assert_eq!(record.times_s(), plain.times_s(), "{text}");
        assert!(record.channels().is_empty(), "{text}");
        for (a, b) in record.temperature_k().iter().zip(plain.temperature_k()) {
            assert!((a - b).abs() < 1e-12 * b, "{text}");
        }
        for (a, b) in record.rate_rad_per_s().iter().zip(plain.rate_rad_per_s()) {
            assert!((a - b).abs() < 1e-12 * b.abs(), "{text}");
        }
        found.remarks.join("\n")
    }

    #[test]
    fn free_lines_above_the_head_are_notes() {
        let rows = PLAIN;
        for above in [
            "Logger X\n",
            "\u{feff}Logger X\r\n\r\nSerial number,1234\nChannels: T1, T2; rate\n# a comment\n",
            "[Header]\nInterval = 60\n\"a note, in quotes\",,\n[Data]\n",
            "Started,2026-03-01 10:00:00,by\nOperator,NN,\n",
        ] {
            let said = same_as_plain("", &format!("{above}{rows}"));
            assert!(said.contains("above it"), "{said}");
        }
        assert!(same_as_plain("", rows).is_empty());
    }

    #[test]
    fn a_row_below_the_names_states_units() {
        for (mapping, text) in [
            ("", "time,temperature,rate\nmin,K,°/s\n0,293.15,0.001\n1,294.65,0.002\n3,298.15,-0.001\n"),
            (
                "time=Zeit,temperature=T1,rate=Omega",
                "Anlage 3;Probe 7\n\nZeit;Status;T1;Omega\n[min];;(°F);[deg/s]\n0;OK;68;0,001\n1;OK;70,7;0,002\n3;OK;77;-0,001\n",
            ),
            // What the mapping says comes first.
            ("time=t:min", "t,temperature_c,rate\ns,,deg/h\n0,20,3.6\n1,21.5,7.2\n3,25,-3.6\n"),
        ] {
            let said = same_as_plain(mapping, text);
            assert!(said.contains("states units"), "{said}");
        }
    }

    #[test]
    fn date_and_time_in_two_columns_are_one_stamp() {
        for (mapping, text) in [
            (
                "",
                "date,time,temperature_c,rate_deg_per_h\n2026-02-28,23:59:00,20,3.6\n2026-03-01,00:00:00,21.5,7.2\n2026-03-01,00:02:00,25,-3.6\n",
            ),
            (
                "date=Datum,time=Uhrzeit,temperature=T1:c,rate=w:deg_per_h",
                "w;Uhrzeit;T1;Datum\n3,6;23:59:00;20;28.02.2026\n7,2;00:00:00;21,5;01.03.2026\n-3,6;00:02:00;25;01.03.2026\n",
            ),
            // Seconds of the day, and a row of patterns.
            (
                "date=Day,time=T:s",
                "Day,T,temperature,rate\nyyyy-mm-dd,s,°C,deg/h\n2026-02-28,86340,20,3.6\n2026-03-01,0,21.5,7.2\n2026-03-01,120,25,-3.6\n",
            ),
        ] {
            same_as_plain(mapping, text);
        }
    }

    #[test]
    fn what_is_no_head_is_said_of_the_likeliest_row() {
        for (text, wanted) in [
            ("Logger X\nSerial,12\ntime_s,temprature_c,rate_deg_per_h\n0,20,1\n1,20,1\n", "found temprature_c"),
            (
                "time,temperature_c,rate_deg_per_h\ns,°F,°/h\n0,20,1\n1,20,1\n2,20,1\n",
                "in c by its name and in f by the row below",
            ),
            (
                "date,time,temperature_c,rate_deg_per_h\n03/01/2026,10:00,20,1\n",
                "line 2, column date: expected a date such as",
            ),
            (
                "date,time,temperature_c,rate_deg_per_h\n2026-03-01,2026-03-01 10:00:00,20,1\n",
                "line 2, column time: expected a time of day beside the date",
            ),
            // A row of numbers is never a note.
            ("0,20,1\ntime_s,temperature_c,rate_deg_per_h\n1,20,1\n", "the first line holds numbers"),
        ] {
            let said = read("", text).unwrap_err();
            assert!(said.contains(wanted), "{text}: {said}");
        }
    }
}
