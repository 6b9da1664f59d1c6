//! Which variables of a file are columns of one table: those of the length that most have.

use std::collections::BTreeMap;

/// A variable with more columns than this is no table of a logger.
const MOST_COLUMNS: u64 = 1024;
/// Names that a remark lists.
const MOST_NAMED: usize = 8;

/// What is known of a variable before its values are.
#[derive(Debug, Clone, Default)]
pub(super) struct VariableShape {
    /// The names of what it stands in, outermost first, and its own.
    pub(crate) path: Vec<String>,
    pub(crate) dims: Vec<u64>,
    /// Of its columns, where the file has them.
    pub(crate) names: Vec<String>,
}

/// One column of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Placed {
    pub(crate) name: String,
    /// Which variable,
    pub(crate) variable: usize,
    /// which of its dimensions the rows are,
    pub(crate) axis: usize,
    /// and which place in the other one.
    pub(crate) index: u64,
}

#[derive(Debug)]
pub(super) struct VariableLayout {
    pub(crate) rows: u64,
    pub(crate) columns: Vec<Placed>,
    /// What is in none of the columns, in words.
    pub(crate) remarks: Vec<String>,
}

impl VariableShape {
    /// The lengths that it may have as columns, each with the number of them.
    fn lengths(&self) -> Vec<(u64, u64)> {
        match *self.dims.as_slice() {
            [n] | [n, 1] | [1, n] => vec![(n, 1)],
            [n, k] => vec![(n, k), (k, n)],
            _ => Vec::new(),
        }
    }

    fn leaf(&self) -> &str {
        self.path.last().map_or("", String::as_str)
    }
}

/// Lays the table out; `unread` names what the file has besides.
///
/// # Errors
/// No two variables of one length.
pub(super) fn laid_out(shapes: &[VariableShape], unread: &[String]) -> Result<VariableLayout, String> {
    let mut votes: BTreeMap<u64, u64> = BTreeMap::new();
    for shape in shapes {
        // Of a matrix the longer side is the rows.
        if let Some((length, columns)) = shape.lengths().into_iter().max() {
            *votes.entry(length).or_default() += columns.min(MOST_COLUMNS);
        }
    }
    let most = votes.iter().filter(|(length, _)| **length > 1).max_by_key(|(length, count)| (**count, **length));
    let rows = most.filter(|(_, count)| **count > 1).map(|(length, _)| *length).ok_or_else(|| {
        let found: Vec<&str> =
            shapes.iter().map(VariableShape::leaf).chain(unread.iter().map(String::as_str)).collect();
        format!(
            "expected variables of one length, such as time_s, temperature_c and rate_deg_per_h, found {}",
            if found.is_empty() { "none that holds numbers".to_owned() } else { listed(&found) }
        )
    })?;
    let mut columns = Vec::new();
    let mut left_out: Vec<&str> = Vec::new();
    for (variable, shape) in shapes.iter().enumerate() {
        let count = shape.lengths().into_iter().find(|(length, _)| *length == rows).map(|(_, count)| count);
        let Some(count) = count.filter(|count| *count <= MOST_COLUMNS) else {
            left_out.push(shape.leaf());
            continue;
        };
        let axis = shape.dims.iter().position(|n| *n == rows).unwrap_or(0);
        columns.extend((0..count).map(|index| Placed { name: String::new(), variable, axis, index }));
    }
    for i in 0..columns.len() {
        let shape = &shapes[columns[i].variable];
        let is_one = columns.iter().filter(|c| c.variable == columns[i].variable).count() == 1;
        let has_twin = |c: &Placed| c.variable != columns[i].variable && shapes[c.variable].leaf() == shape.leaf();
        let own = if columns.iter().any(has_twin) { shape.path.join(".") } else { shape.leaf().to_owned() };
        let stated = usize::try_from(columns[i].index).ok().and_then(|index| shape.names.get(index));
        columns[i].name = match stated {
            Some(stated) => stated.clone(),
            None if is_one => own,
            None => format!("{own}_{}", columns[i].index + 1),
        };
    }
    left_out.extend(unread.iter().map(String::as_str));
    let remarks = match left_out.as_slice() {
        [] => Vec::new(),
        some => vec![format!("no columns of {rows} rows, and left out: {}", listed(some))],
    };
    Ok(VariableLayout { rows, columns, remarks })
}

fn listed(names: &[&str]) -> String {
    let shown = names.iter().take(MOST_NAMED).copied().collect::<Vec<_>>().join(", ");
    if names.len() > MOST_NAMED { format!("{shown} and {} more", names.len() - MOST_NAMED) } else { shown }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(path: &str, dims: &[u64]) -> VariableShape {
        VariableShape { path: path.split('.').map(str::to_owned).collect(), dims: dims.to_vec(), names: Vec::new() }
    }

    #[test]
    fn the_length_that_most_have_makes_the_table_and_the_rest_is_named() {
        let shapes = [shape("log.t", &[1, 9]), shape("T", &[9, 2]), shape("b.t", &[9]), shape("fs", &[1, 1])];
        let layout = laid_out(&shapes, &["note".to_owned()]).unwrap();
        let found: Vec<(&str, usize, usize, u64)> =
            layout.columns.iter().map(|c| (c.name.as_str(), c.variable, c.axis, c.index)).collect();
        assert_eq!(found, [("log.t", 0, 1, 0), ("T_1", 1, 0, 0), ("T_2", 1, 0, 1), ("b.t", 2, 0, 0)]);
        assert_eq!((layout.rows, layout.remarks), (9, vec!["no columns of 9 rows, and left out: fs, note".to_owned()]));
    }

    #[test]
    fn a_file_without_a_table_says_what_it_has() {
        let message = laid_out(&[shape("a", &[1, 1]), shape("b", &[5, 5, 5])], &[]).unwrap_err();
        assert!(message.ends_with("found a, b"), "{message}");
        assert!(laid_out(&[], &[]).unwrap_err().contains("none that holds numbers"));
    }
}
