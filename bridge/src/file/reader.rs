//! Reads TOML with the place of every value at hand, so that each error names line, field and remedy.
//!
//! A [`Table`] is opened with the keys that it may have, and refuses any other at once: a misspelt key is
//! reported as such, not as a missing one.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{FileError, Place, suggestion};

/// What reading yields.
pub(crate) type Outcome<V> = Result<V, Box<FileError>>;

/// A text and its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Source {
    pub(crate) name: String,
    pub(crate) text: String,
}

impl Source {
    /// An error about `field` at a span of bytes.
    pub(crate) fn error(&self, span: &Range<usize>, field: &str, message: String, help: String) -> Box<FileError> {
        let place = Some(Place::of(&self.text, span));
        Box::new(FileError { name: self.name.clone(), place, field: field.to_owned(), message, help })
    }

    /// Parses the text.
    pub(crate) fn document(&self) -> Outcome<Spanned<DeTable<'_>>> {
        DeTable::parse(&self.text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let help =
                "a TOML line reads `key = value`, with text in \"quotes\", lists in [ ] and headings in [ ] or [[ ]]";
            self.error(&span, "", format!("is not valid TOML: {}", error.message()), help.to_owned())
        })
    }

    /// Span of the deepest part of `path` (`agent[0].speed_max`) that the text has, and whether that is all of it.
    pub(crate) fn locate(&self, path: &str) -> Option<(Range<usize>, bool)> {
        let document = DeTable::parse(&self.text).ok()?;
        let mut span = None;
        let mut table = document.get_ref();
        let mut steps = path.split('.').peekable();
        while let Some(step) = steps.next() {
            let (key, indices) = split_indices(step);
            let Some((key, mut value)) = table.get_key_value(key) else { return span.map(|span| (span, false)) };
            span = Some(key.span());
            for index in indices {
                let Some(entry) = value.get_ref().as_array().and_then(|array| array.get(index)) else {
                    return span.map(|span| (span, false));
                };
                value = entry;
                span = Some(value.span());
            }
            match (value.get_ref().as_table(), steps.peek()) {
                (Some(inner), Some(_)) => table = inner,
                (None, Some(_)) => return span.map(|span| (span, false)),
                (_, None) => {}
            }
        }
        span.map(|span| (span, true))
    }
}

/// `track[3]` is `track` and 3.
fn split_indices(step: &str) -> (&str, Vec<usize>) {
    let (key, rest) = step.split_once('[').unwrap_or((step, ""));
    (key, rest.split(['[', ']']).filter_map(|index| index.parse().ok()).collect())
}

/// A table of the file, with its path.
pub(crate) struct Table<'a> {
    source: &'a Source,
    table: &'a DeTable<'a>,
    span: Range<usize>,
    /// Path from the top; empty at the top.
    path: String,
    keys: &'static [&'static str],
}

/// A value of the file, with its path.
pub(crate) struct Value<'a> {
    source: &'a Source,
    value: &'a Spanned<DeValue<'a>>,
    /// Path from the top.
    pub(crate) path: String,
}

impl<'a> Table<'a> {
    /// The whole document.
    pub(crate) fn top(
        source: &'a Source,
        document: &'a Spanned<DeTable<'a>>,
        keys: &'static [&'static str],
    ) -> Outcome<Self> {
        Self { source, table: document.get_ref(), span: 0..0, path: String::new(), keys }.checked()
    }

    /// Refuses keys that are not known.
    fn checked(self) -> Outcome<Self> {
        let unknown =
            self.table.iter().map(|(key, _)| key).filter(|key| !self.keys.contains(&key.get_ref().as_ref()));
        match unknown.min_by_key(|key| key.span().start) {
            None => Ok(self),
            Some(key) => {
                let help = suggestion(key.get_ref(), self.keys, "keys here are");
                Err(self.source.error(&key.span(), &self.path_of(key.get_ref()), "is not a known key".into(), help))
            }
        }
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// An error about a key of this table.
    pub(crate) fn error(&self, key: &str, message: impl Into<String>, help: impl Into<String>) -> Box<FileError> {
        let span = self.table.get_key_value(key).map_or(self.span.clone(), |(key, _)| key.span());
        self.source.error(&span, &self.path_of(key), message.into(), help.into())
    }

    /// The value of a key, where it is there.
    pub(crate) fn optional(&self, key: &str) -> Option<Value<'a>> {
        debug_assert!(self.keys.contains(&key), "{key} is read but not listed");
        let value = self.table.get(key)?;
        Some(Value { source: self.source, value, path: self.path_of(key) })
    }

    /// The value of a key that must be there.
    pub(crate) fn required(&self, key: &str, example: &str) -> Outcome<Value<'a>> {
        self.optional(key).ok_or_else(|| self.error(key, "is missing", format!("add `{key} = {example}`")))
    }

    /// A finite number.
    pub(crate) fn number(&self, key: &str) -> Outcome<f64> {
        self.required(key, "1.0")?.number()
    }

    /// A finite number, where it is there.
    pub(crate) fn number_optional(&self, key: &str) -> Outcome<Option<f64>> {
        self.optional(key).map(|value| value.number()).transpose()
    }

    /// A finite number, or what it is when left out.
    pub(crate) fn number_or(&self, key: &str, default: f64) -> Outcome<f64> {
        Ok(self.number_optional(key)?.unwrap_or(default))
    }

    /// A text, where it is there.
    pub(crate) fn text_optional(&self, key: &str) -> Outcome<Option<String>> {
        self.optional(key).map(|value| value.text().map(str::to_owned)).transpose()
    }

    /// One of several words.
    pub(crate) fn choice<V: Copy>(&self, key: &str, choices: &[(&str, V)], default: Option<V>) -> Outcome<V> {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let Some(value) = self.optional(key) else {
            let help = format!("`{key}` is one of {}", super::error::listed(&names));
            return default.ok_or_else(|| self.error(key, "is missing", help));
        };
        let given = value.text()?;
        match choices.iter().find(|(name, _)| *name == given) {
            Some((_, choice)) => Ok(*choice),
            None => Err(value.error(format!("must not be `{given}`"), suggestion(given, &names, "it can be"))),
        }
    }

    /// A table within, where it is there.
    pub(crate) fn table(&self, key: &str, keys: &'static [&'static str]) -> Outcome<Option<Table<'a>>> {
        self.optional(key).map(|value| value.table(keys)).transpose()
    }

    /// A list of tables within, empty where it is not there.
    pub(crate) fn tables(&self, key: &str, keys: &'static [&'static str]) -> Outcome<Vec<Table<'a>>> {
        let Some(list) = self.optional(key) else { return Ok(Vec::new()) };
        if matches!(list.value.get_ref(), DeValue::Table(_)) {
            return Err(list.error("must be a list of tables", format!("write [[{}]] with two brackets", list.path)));
        }
        list.entries()?.into_iter().map(|entry| entry.table(keys)).collect()
    }
}

impl<'a> Value<'a> {
    /// An error about this value.
    pub(crate) fn error(&self, message: impl Into<String>, help: impl Into<String>) -> Box<FileError> {
        self.source.error(&self.value.span(), &self.path, message.into(), help.into())
    }

    fn wrong_type(&self, wanted: &str, help: &str) -> Box<FileError> {
        let given = match self.value.get_ref() {
            DeValue::String(_) => "text",
            DeValue::Integer(_) => "a whole number",
            DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.error(format!("must be {wanted}, not {given}"), help)
    }

    /// A finite number.
    pub(crate) fn number(&self) -> Outcome<f64> {
        let number = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => {
                i128::from_str_radix(integer.as_str(), integer.radix()).ok().map(|whole| whole as f64)
            }
            _ => return Err(self.wrong_type("a number", "write it without quotes, such as 1.5")),
        };
        match number {
            Some(number) if f64::is_finite(number) => Ok(number),
            _ => Err(self.error("is not a finite number", "write a number such as 1.5")),
        }
    }

    /// A whole number that is not negative.
    pub(crate) fn count(&self) -> Outcome<usize> {
        let DeValue::Integer(integer) = self.value.get_ref() else {
            return Err(self.wrong_type("a whole number", "write it without a decimal point, such as 60"));
        };
        match i128::from_str_radix(integer.as_str(), integer.radix()) {
            Ok(whole) if whole < 0 => {
                Err(self.error(format!("must not be negative, but is {whole}"), "write a whole number such as 60"))
            }
            Ok(whole) if usize::try_from(whole).is_ok() => Ok(usize::try_from(whole).unwrap_or_default()),
            _ => Err(self.error("is too large", "write a whole number such as 60")),
        }
    }

    /// True or false.
    pub(crate) fn truth(&self) -> Outcome<bool> {
        match self.value.get_ref() {
            DeValue::Boolean(truth) => Ok(*truth),
            _ => Err(self.wrong_type("true or false", "write `true` or `false`, without quotes")),
        }
    }

    /// A text.
    pub(crate) fn text(&self) -> Outcome<&'a str> {
        match self.value.get_ref() {
            DeValue::String(text) => Ok(text),
            _ => Err(self.wrong_type("text", "write it in \"quotes\"")),
        }
    }

    /// The entries of a list.
    pub(crate) fn entries(&self) -> Outcome<Vec<Value<'a>>> {
        let DeValue::Array(array) = self.value.get_ref() else {
            return Err(self.wrong_type("a list", "write it in square brackets, such as [1.0, 2.0]"));
        };
        let entry = |(index, value)| Value { source: self.source, value, path: format!("{}[{index}]", self.path) };
        Ok(array.iter().enumerate().map(entry).collect())
    }

    /// A list of exactly `count` finite numbers.
    pub(crate) fn point(&self, count: usize) -> Outcome<Vec<f64>> {
        let entries = self.entries()?;
        if entries.len() != count {
            let shape = if count == 2 { "[east, north]" } else { "[east, north, up]" };
            let message = format!("must have {count} numbers, not {}", entries.len());
            return Err(self.error(message, format!("write {shape}")));
        }
        entries.iter().map(Value::number).collect()
    }

    /// A table.
    pub(crate) fn table(&self, keys: &'static [&'static str]) -> Outcome<Table<'a>> {
        let DeValue::Table(table) = self.value.get_ref() else {
            return Err(self.wrong_type("a table", "write { key = value, .. }, or a [heading] with keys below it"));
        };
        Table { source: self.source, table, span: self.value.span(), path: self.path.clone(), keys }.checked()
    }

    /// A table whose keys depend on the word at `key`: the choices are words with their keys.
    pub(crate) fn variant(
        &self,
        key: &'static str,
        models: &[(&str, &'static [&'static str])],
    ) -> Outcome<Table<'a>> {
        let DeValue::Table(table) = self.value.get_ref() else {
            return Err(self.wrong_type("a table", &format!("write {{ {key} = \"..\", .. }}")));
        };
        let peek = Table { source: self.source, table, span: self.value.span(), path: self.path.clone(), keys: &[] };
        let names: Vec<&str> = models.iter().map(|(name, _)| *name).collect();
        let Some(value) = table.get(key) else {
            let help = format!("`{key}` is one of {}", super::error::listed(&names));
            return Err(peek.error(key, "is missing", help));
        };
        let value = Value { source: self.source, value, path: peek.path_of(key) };
        let given = value.text()?;
        match models.iter().find(|(name, _)| *name == given) {
            Some((_, keys)) => Table { keys, ..peek }.checked(),
            None => Err(value.error(format!("must not be `{given}`"), suggestion(given, &names, "it can be"))),
        }
    }
}
