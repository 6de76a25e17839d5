//! Where the fields of a message stand.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Most formats, and most text of all together, bytes.
const MOST_FORMATS: usize = 4096;
const MOST_TEXT_BYTES: usize = 4 << 20;
/// Most messages within messages.
const MOST_DEPTH: usize = 8;
/// A message is never longer: its length has two bytes.
const MOST_BYTES: usize = 0xffff;

/// A plain type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
#[non_exhaustive]
pub enum Kind {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float,
    Double,
    Bool,
    Char,
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "int8_t" => Self::Int8,
            "uint8_t" => Self::UInt8,
            "int16_t" => Self::Int16,
            "uint16_t" => Self::UInt16,
            "int32_t" => Self::Int32,
            "uint32_t" => Self::UInt32,
            "int64_t" => Self::Int64,
            "uint64_t" => Self::UInt64,
            "float" => Self::Float,
            "double" => Self::Double,
            "bool" => Self::Bool,
            "char" => Self::Char,
            _ => return None,
        })
    }

    /// Bytes that it takes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Int8 | Self::UInt8 | Self::Bool | Self::Char => 1,
            Self::Int16 | Self::UInt16 => 2,
            Self::Int32 | Self::UInt32 | Self::Float => 4,
            Self::Int64 | Self::UInt64 | Self::Double => 8,
        }
    }

    fn read(self, data: &[u8], at: usize) -> Option<Number> {
        fn bytes<const N: usize>(data: &[u8], at: usize) -> Option<[u8; N]> {
            data.get(at..)?.first_chunk().copied()
        }
        Some(match self {
            Self::Int8 => Number::Signed(i8::from_le_bytes(bytes(data, at)?).into()),
            Self::Int16 => Number::Signed(i16::from_le_bytes(bytes(data, at)?).into()),
            Self::Int32 => Number::Signed(i32::from_le_bytes(bytes(data, at)?).into()),
            Self::Int64 => Number::Signed(i64::from_le_bytes(bytes(data, at)?)),
            Self::UInt8 | Self::Bool | Self::Char => Number::Unsigned(u8::from_le_bytes(bytes(data, at)?).into()),
            Self::UInt16 => Number::Unsigned(u16::from_le_bytes(bytes(data, at)?).into()),
            Self::UInt32 => Number::Unsigned(u32::from_le_bytes(bytes(data, at)?).into()),
            Self::UInt64 => Number::Unsigned(u64::from_le_bytes(bytes(data, at)?)),
            Self::Float => Number::Real(f32::from_le_bytes(bytes(data, at)?).into()),
            Self::Double => Number::Real(f64::from_le_bytes(bytes(data, at)?)),
        })
    }
}

/// The content of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Number {
    /// Of `uint*_t`, `bool` and `char`.
    Unsigned(u64),
    /// Of `int*_t`.
    Signed(i64),
    /// Of `float` and `double`, which may be no finite number.
    Real(f64),
}

impl Number {
    /// The nearest real number.
    #[allow(clippy::cast_precision_loss, reason = "integers beyond 2^53 are no quantities")]
    pub const fn real(self) -> f64 {
        match self {
            Self::Unsigned(number) => number as f64,
            Self::Signed(number) => number as f64,
            Self::Real(number) => number,
        }
    }
}

/// A name of a message or a field.
///
/// # Errors
/// That it is none.
pub(super) fn name(bytes: &[u8]) -> Result<&str, String> {
    let is_allowed = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'/');
    match core::str::from_utf8(bytes) {
        Ok(name) if !name.is_empty() && name.len() <= 255 && bytes.iter().all(is_allowed) => Ok(name),
        _ => Err(format!("`{}` is no name", bytes.get(..bytes.len().min(40)).unwrap_or_default().escape_ascii())),
    }
}

#[derive(Debug)]
enum What {
    Plain(Kind),
    Nested(Arc<Layout>),
}

#[derive(Debug)]
struct Field {
    name: String,
    what: What,
    /// Elements of an array; `None` of a single one.
    count: Option<usize>,
    offset: usize,
}

impl Field {
    fn element_bytes(&self) -> usize {
        match &self.what {
            What::Plain(kind) => kind.bytes(),
            What::Nested(layout) => layout.bytes,
        }
    }

    fn is_padding(&self) -> bool {
        self.name.starts_with("_padding")
    }
}

/// The fields of a message, with their places.
#[derive(Debug)]
pub struct Layout {
    fields: Vec<Field>,
    bytes: usize,
    depth: usize,
}

impl Layout {
    /// How long its data may be: padding at the end is not logged.
    pub(super) fn lengths(&self) -> RangeInclusive<usize> {
        let padding = self.fields.last().filter(|field| field.is_padding());
        padding.map_or(self.bytes, |field| field.offset)..=self.bytes
    }

    /// A field by its path, such as `q[0]` or `esc[1].rpm`; `None` where it is not there.
    pub(super) fn number(&self, data: &[u8], path: &str) -> Option<Number> {
        let (mut layout, mut base, mut rest) = (self, 0, path);
        loop {
            let (step, behind) = rest.split_once('.').map_or((rest, None), |(step, behind)| (step, Some(behind)));
            let (name, index) = match step.split_once('[') {
                Some((name, index)) => (name, Some(index.strip_suffix(']')?.parse::<usize>().ok()?)),
                None => (step, None),
            };
            let field = layout.fields.iter().find(|field| field.name == name)?;
            let element = match (index, field.count) {
                (None, None) => 0,
                (Some(index), Some(count)) if index < count => index,
                _ => return None,
            };
            let at = base + field.offset + element * field.element_bytes();
            match (&field.what, behind) {
                (What::Plain(kind), None) => return kind.read(data, at),
                (What::Nested(nested), Some(behind)) => (layout, base, rest) = (nested, at, behind),
                _ => return None,
            }
        }
    }

    /// The path of every number, in order, without padding.
    pub fn paths(&self) -> Vec<String> {
        let mut paths = Vec::new();
        self.collect("", &mut paths);
        paths
    }

    fn collect(&self, before: &str, paths: &mut Vec<String>) {
        for field in self.fields.iter().filter(|field| !field.is_padding()) {
            for element in 0..field.count.unwrap_or(1) {
                let index = field.count.map_or(String::new(), |_| format!("[{element}]"));
                let path = format!("{before}{}{index}", field.name);
                match &field.what {
                    What::Plain(_) => paths.push(path),
                    What::Nested(layout) => layout.collect(&format!("{path}."), paths),
                }
            }
        }
    }

    /// Elements of an array of numbers; `None` where there is none of this name.
    pub fn elements(&self, name: &str) -> Option<usize> {
        self.fields.iter().find(|field| field.name == name && matches!(field.what, What::Plain(_)))?.count
    }
}

/// The formats that a file describes.
#[derive(Default)]
pub(super) struct Formats {
    /// The list of fields behind the colon.
    texts: HashMap<String, String>,
    layouts: HashMap<String, Arc<Layout>>,
    text_bytes: usize,
}

impl Formats {
    /// Takes `name:type field;type field;`.
    ///
    /// # Errors
    /// Why it is left out.
    pub(super) fn add(&mut self, text: &[u8]) -> Result<(), String> {
        let colon = text.iter().position(|byte| *byte == b':').ok_or("a format without a name")?;
        let (name_bytes, fields) = text.split_at(colon);
        let name = name(name_bytes)?;
        let fields =
            core::str::from_utf8(fields.get(1..).unwrap_or_default()).map_err(|_| "a format that is no text")?;
        match self.texts.get(name) {
            Some(same) if same == fields => return Ok(()),
            Some(_) => return Err(format!("a second format of the name {name}")),
            None => {}
        }
        self.text_bytes += text.len();
        if self.texts.len() >= MOST_FORMATS || self.text_bytes > MOST_TEXT_BYTES {
            return Err(format!("more than {MOST_FORMATS} formats or {MOST_TEXT_BYTES} bytes of them"));
        }
        self.texts.insert(name.to_owned(), fields.to_owned());
        Ok(())
    }

    /// The layout of a format, whose own parts may have been described after it.
    ///
    /// # Errors
    /// Why it has none.
    pub(super) fn layout(&mut self, name: &str) -> Result<Arc<Layout>, String> {
        let layout = self.resolve(name, MOST_DEPTH)?;
        match layout.fields.iter().find(|field| field.name == "timestamp") {
            Some(Field { what: What::Plain(Kind::UInt64), count: None, .. }) => Ok(layout),
            _ => Err(format!("{name} has no `uint64_t timestamp`")),
        }
    }

    fn resolve(&mut self, of: &str, depth: usize) -> Result<Arc<Layout>, String> {
        if let Some(layout) = self.layouts.get(of) {
            // A layout that is known may be too deep for this place all the same.
            return if layout.depth <= depth { Ok(Arc::clone(layout)) } else { Err(too_deep(of)) };
        }
        let left = depth.checked_sub(1).ok_or_else(|| too_deep(of))?;
        let text = self.texts.get(of).cloned().ok_or_else(|| format!("{of} has no format"))?;
        let mut layout = Layout { fields: Vec::new(), bytes: 0, depth: 1 };
        for field in text.split(';').filter(|field| !field.is_empty()) {
            let bad = || format!("`{}` is no field of {of}", field.escape_debug().take(40).collect::<String>());
            let (type_name, field_name) = field.split_once(' ').ok_or_else(bad)?;
            let (type_name, count) = match type_name.split_once('[') {
                Some((type_name, count)) => {
                    let count = count.strip_suffix(']').and_then(|count| count.parse::<u16>().ok());
                    (type_name, Some(usize::from(count.filter(|count| *count > 0).ok_or_else(bad)?)))
                }
                None => (type_name, None),
            };
            let what = match Kind::of(type_name) {
                Some(kind) => What::Plain(kind),
                None => What::Nested(self.resolve(name(type_name.as_bytes())?, left)?),
            };
            if let What::Nested(nested) = &what {
                layout.depth = layout.depth.max(nested.depth + 1);
            }
            let field = Field { name: name(field_name.as_bytes())?.to_owned(), what, count, offset: layout.bytes };
            layout.bytes += field.element_bytes() * count.unwrap_or(1);
            if layout.bytes > MOST_BYTES {
                return Err(format!("{of} is longer than a message can be"));
            }
            layout.fields.push(field);
        }
        if layout.bytes == 0 {
            return Err(format!("{of} has no fields"));
        }
        let layout = Arc::new(layout);
        self.layouts.insert(of.to_owned(), Arc::clone(&layout));
        Ok(layout)
    }
}

fn too_deep(of: &str) -> String {
    format!("{of} stands more than {MOST_DEPTH} messages deep")
}
