//! Model files: read, made of keyword arguments, changed with their comments kept, written.

use std::path::PathBuf;
use std::sync::Arc;

use coilwright::effect::{CATALOGUE, CHANNEL, CUSTOM, THERMAL_STRESS};
use coilwright::io::files::write_atomically;
use coilwright::io::json::effects::{EffectJson, EffectsJson};
use coilwright::io::json::{CheckJson, FaultJson};
use coilwright::io::model::ModelFile;
use coilwright::io::read::model_file;
use coilwright::io::read::plausibility::advice;
use coilwright::io::read::profile_file::read_profile_file;
use coilwright::task::TaskError;
use coilwright::task::extend::unknown_effect;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyList};
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value};

use crate::error::{raise, wrong};
use crate::tasks::json;

/// A model file, understood.
#[pyclass(frozen, module = "coilwright._coilwright")]
pub struct ModelHandle {
    pub file: Arc<ModelFile>,
}

#[pyfunction]
pub fn read_model(py: Python, path: PathBuf) -> PyResult<ModelHandle> {
    let file = model_file::read_model(&path).map_err(|e| raise(py, e))?;
    Ok(ModelHandle { file: Arc::new(file) })
}

#[pymethods]
impl ModelHandle {
    /// Of a text; `path` places relative pattern files and names the source.
    #[staticmethod]
    fn parsed(py: Python, source: &str, path: PathBuf) -> PyResult<Self> {
        let file = model_file::parse_model(&path, source).map_err(|e| raise(py, e))?;
        Ok(Self { file: Arc::new(file) })
    }

    /// Of tables, as a model file has them.
    #[staticmethod]
    fn of_tables(py: Python, tables: &Bound<PyDict>, path: PathBuf) -> PyResult<Self> {
        let mut document = DocumentMut::new();
        merge(py, document.as_table_mut(), tables)?;
        Self::parsed(py, &document.to_string(), path)
    }

    /// With some of its tables' keys changed, all else kept; a key whose value is None goes.
    fn changed(&self, py: Python, tables: &Bound<PyDict>) -> PyResult<Self> {
        let mut document: DocumentMut =
            self.file.source.parse().map_err(|e: toml_edit::TomlError| wrong(py, e.to_string()))?;
        merge(py, document.as_table_mut(), tables)?;
        Self::parsed(py, &document.to_string(), self.file.path.clone())
    }

    /// As another file.
    fn moved(&self, py: Python, path: PathBuf) -> PyResult<Self> {
        Self::parsed(py, &self.file.source, path)
    }

    /// With the profiles of a file that has a [profiles] table.
    fn with_profiles(&self, py: Python, path: PathBuf) -> PyResult<Self> {
        let profiles = read_profile_file(&path).map_err(|e| raise(py, e))?;
        Ok(Self { file: Arc::new(ModelFile { profiles, ..(*self.file).clone() }) })
    }

    fn write(&self, py: Python, path: PathBuf) -> PyResult<()> {
        write_atomically(&path, self.file.source.as_bytes()).map_err(|e| raise(py, e))
    }

    /// Every table and key, as plain Python.
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let document: DocumentMut =
            self.file.source.parse().map_err(|e: toml_edit::TomlError| wrong(py, e.to_string()))?;
        plain_table(py, document.as_table())
    }

    #[getter]
    fn source(&self) -> &str {
        &self.file.source
    }

    #[getter]
    fn path(&self) -> String {
        self.file.path.display().to_string()
    }

    #[getter]
    fn name(&self) -> &str {
        &self.file.model.name
    }

    #[getter]
    fn layers(&self) -> usize {
        self.file.model.coil.layers()
    }

    #[getter]
    fn length_m(&self) -> f64 {
        self.file.model.coil.length_m()
    }

    #[getter]
    fn mean_diameter_m(&self) -> f64 {
        self.file.model.coil.mean_diameter_m()
    }

    /// Innermost layer first.
    #[getter]
    fn layer_lengths_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.file.model.coil.layer_lengths_m())
    }

    #[getter]
    fn pattern(&self) -> Option<(String, Vec<usize>, (i32, i32))> {
        let named = self.file.pattern.as_ref()?;
        let ends = named.pattern.end_turns();
        Some((named.name.clone(), named.pattern.segments().to_vec(), (ends.a, ends.b)))
    }

    #[getter]
    fn effects(&self) -> Vec<String> {
        self.file.model.effects.iter().map(|e| e.kind()).collect()
    }

    #[getter]
    fn profiles(&self) -> Vec<String> {
        self.file.profiles.profiles().iter().map(|p| p.name().to_owned()).collect()
    }

    #[getter]
    fn windability(&self) -> String {
        self.file.search.windability.to_string()
    }

    #[getter]
    fn objective(&self) -> &'static str {
        self.file.search.objective.key()
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.file.search.seed
    }

    #[getter]
    fn advice(&self) -> Vec<String> {
        advice(&self.file).iter().map(ToString::to_string).collect()
    }
}

/// All faults of a model file at once, as the command `check` prints them.
#[pyfunction]
pub fn check_model(py: Python, path: PathBuf) -> PyResult<String> {
    let file = path.display().to_string();
    let body = match model_file::read_model(&path) {
        Ok(found) => {
            CheckJson { file, faults: Vec::new(), advice: advice(&found).iter().map(ToString::to_string).collect() }
        }
        Err(faults) => CheckJson { file, faults: FaultJson::all(&faults), advice: Vec::new() },
    };
    json(py, &body)
}

/// The effects that a model file can declare, as the command `effects` prints them.
#[pyfunction]
pub fn effects(py: Python, kinds: Vec<String>) -> PyResult<String> {
    let known = || CATALOGUE.iter().copied().chain([CHANNEL, CUSTOM, THERMAL_STRESS]);
    if let Some(stated) = kinds.iter().find(|stated| known().all(|spec| spec.kind != *stated)) {
        return Err(raise(py, unknown_effect(stated)));
    }
    let chosen = known().filter(|spec| kinds.is_empty() || kinds.iter().any(|k| k == spec.kind));
    json(py, &EffectsJson { effects: chosen.map(EffectJson::of).collect() })
}

/// Puts the keys of a dictionary into a table: dictionaries into tables of their own, None takes a key away.
fn merge(py: Python, table: &mut Table, changes: &Bound<PyDict>) -> PyResult<()> {
    for (key, value) in changes.iter() {
        let key: String = key.extract().map_err(|_| wrong(py, "the keys of a model's tables are texts"))?;
        if value.is_none() {
            table.remove(&key);
        } else if let Ok(inner) = value.cast::<PyDict>() {
            let item = table.entry(&key).or_insert_with(toml_edit::table);
            match item.as_table_mut() {
                Some(inner_table) => merge(py, inner_table, inner)?,
                None => *item = Item::Value(value_of(py, &key, &value)?),
            }
        } else {
            put(py, table, &key, &value)?;
        }
    }
    Ok(())
}

/// A plain value; lists of dictionaries become tables of their own.
fn put(py: Python, table: &mut Table, key: &str, value: &Bound<PyAny>) -> PyResult<()> {
    if let Ok(list) = value.cast::<PyList>()
        && !list.is_empty()
        && list.iter().all(|entry| entry.is_instance_of::<PyDict>())
    {
        let mut tables = ArrayOfTables::new();
        for entry in list.iter() {
            let mut inner = Table::new();
            for (name, value) in entry.cast::<PyDict>().map_err(PyErr::from)?.iter() {
                let name: String = name.extract()?;
                inner.insert(&name, Item::Value(value_of(py, &name, &value)?));
            }
            tables.push(inner);
        }
        table.insert(key, Item::ArrayOfTables(tables));
        return Ok(());
    }
    let new = value_of(py, key, value)?;
    match table.get_mut(key).and_then(Item::as_value_mut) {
        // What stands around the old value stays.
        Some(old) => {
            let decor = old.decor().clone();
            *old = new;
            *old.decor_mut() = decor;
        }
        None => {
            table.insert(key, Item::Value(new));
        }
    }
    Ok(())
}

fn value_of(py: Python, key: &str, value: &Bound<PyAny>) -> PyResult<Value> {
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::from(value.extract::<bool>()?));
    }
    if let Ok(whole) = value.extract::<i64>() {
        return Ok(Value::from(whole));
    }
    if let Ok(text) = value.extract::<String>() {
        return Ok(Value::from(text));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(Value::from(number));
    }
    if let Ok(list) = value.cast::<PyList>() {
        let entries: PyResult<Array> = list.iter().map(|entry| value_of(py, key, &entry)).collect();
        return Ok(Value::Array(entries?));
    }
    if let Ok(inner) = value.cast::<PyDict>() {
        let mut table = InlineTable::new();
        for (name, value) in inner.iter() {
            let name: String = name.extract()?;
            table.insert(&name, value_of(py, &name, &value)?);
        }
        return Ok(Value::InlineTable(table));
    }
    let found = value.get_type().name()?.to_string();
    Err(wrong(py, format!("{key}: expected a number, a text, a truth value, a list or a dictionary, found {found}")))
}

fn plain_table<'py>(py: Python<'py>, table: &dyn toml_edit::TableLike) -> PyResult<Bound<'py, PyAny>> {
    let plain = PyDict::new(py);
    for (key, item) in table.iter() {
        plain.set_item(key, plain_item(py, item)?)?;
    }
    Ok(plain.into_any())
}

fn plain_item<'py>(py: Python<'py>, item: &Item) -> PyResult<Bound<'py, PyAny>> {
    match item {
        Item::None => Ok(py.None().into_bound(py)),
        Item::Value(value) => plain_value(py, value),
        Item::Table(table) => plain_table(py, table),
        Item::ArrayOfTables(tables) => {
            let all: PyResult<Vec<_>> = tables.iter().map(|table| plain_table(py, table)).collect();
            Ok(PyList::new(py, all?)?.into_any())
        }
    }
}

fn plain_value<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::String(text) => text.value().into_pyobject(py)?.into_any(),
        Value::Integer(whole) => (*whole.value()).into_pyobject(py)?.into_any(),
        Value::Float(number) => (*number.value()).into_pyobject(py)?.into_any(),
        Value::Boolean(truth) => PyBool::new(py, *truth.value()).to_owned().into_any(),
        Value::Datetime(time) => time.value().to_string().into_pyobject(py)?.into_any(),
        Value::Array(array) => {
            let all: PyResult<Vec<_>> = array.iter().map(|entry| plain_value(py, entry)).collect();
            PyList::new(py, all?)?.into_any()
        }
        Value::InlineTable(table) => plain_table(py, table)?,
    })
}

/// What cannot be a model's is said like any other fault.
pub fn option(option: &'static str, message: String) -> TaskError {
    TaskError::Option { option, message }
}
