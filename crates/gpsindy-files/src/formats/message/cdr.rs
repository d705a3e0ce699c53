//! Messages in CDR, as ROS 2 writes them: numbers aligned to their size from the begin of the body, arrays after their count.
//!
//! Source: OMG, DDS-XTypes 1.3, section 7.4 (PLAIN_CDR and PLAIN_CDR2).

use crate::formats::message::kind::{Kind, number};
use crate::formats::message::layout::Marks;
use crate::formats::message::path::Step;
use crate::formats::message::schema::{Many, Schema};
use crate::formats::message::want::{Item, LISTS, Node, Slot, Wants};
use std::cell::RefCell;

/// Elements of an array of numbers that are shown one by one.
const SHOWN: usize = 32;

/// Elements of an array of messages that are shown one by one.
const SHOWN_MESSAGES: usize = 8;

/// Fields of a message that are shown at all.
const MOST_LEAVES: usize = 2_000;

/// Bytes before the body, which say how it is written.
const HEAD: usize = 4;

type Broken = String;

/// Takes what is wanted from a message; outputs that it does not carry become NaN.
///
/// # Errors
/// What is wrong with the bytes.
pub(crate) fn take(schema: &Schema, wants: &mut Wants, bytes: &[u8], outputs: &mut [f64]) -> Result<(), Broken> {
    outputs.fill(f64::NAN);
    if wants.layout.take(bytes, outputs) {
        return Ok(());
    }
    let marks = RefCell::new(Marks::default());
    let mut reader = Reader { marks: wants.layout.worthwhile().then_some(&marks), ..Reader::new(bytes)? };
    reader.message(schema, 0, Some(&wants.root), &mut wants.slots, outputs)?;
    if reader.marks.is_some() {
        wants.layout.learn(bytes, reader.big, marks.into_inner());
    }
    Ok(())
}

/// A field of a message, or an element of one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Leaf {
    pub(crate) path: Vec<Step>,
    pub(crate) type_name: String,
    /// Whether it is a number, as opposed to text or a long array.
    pub(crate) number: bool,
}

/// The fields that a message has, the elements of short arrays one by one, by name where it names them.
///
/// # Errors
/// What is wrong with the bytes.
pub(crate) fn leaves(schema: &Schema, bytes: &[u8]) -> Result<Vec<Leaf>, Broken> {
    let mut found = Vec::new();
    Reader::new(bytes)?.leaves(schema, 0, &mut Vec::new(), &[], &mut found)?;
    Ok(found)
}

#[derive(Debug, Clone, Copy)]
struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    big: bool,
    /// The largest alignment: 8, in the second version 4.
    most: usize,
    /// Takes down what decides the shape of the message, and where its numbers are.
    marks: Option<&'a RefCell<Marks>>,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, Broken> {
        let Some((head, body)) = bytes.split_at_checked(HEAD) else {
            return Err(format!("{} bytes, fewer than the head of a CDR message has", bytes.len()));
        };
        let (big, most) = match head[1] {
            0 => (true, 8),
            1 => (false, 8),
            6 => (true, 4),
            7 => (false, 4),
            other => return Err(format!("encapsulation {other} of CDR is not read, only plain CDR")),
        };
        Ok(Self { body, at: 0, big, most, marks: None })
    }

    /// The next `count` values of `size` bytes.
    fn block(&mut self, size: usize, count: usize) -> Result<&'a [u8], Broken> {
        if count == 0 {
            return Ok(&[]);
        }
        let step = size.min(self.most);
        let begin = self.at.next_multiple_of(step);
        let end = count.checked_mul(size).and_then(|n| n.checked_add(begin));
        let Some(bytes) = end.and_then(|end| self.body.get(begin..end)) else {
            return Err(format!("{} bytes end before its last field does", self.body.len() + 4));
        };
        self.at = begin + bytes.len();
        Ok(bytes)
    }

    fn count(&mut self) -> Result<usize, Broken> {
        let bytes = self.block(4, 1)?;
        self.mark(self.at - 4);
        let four = [bytes[0], bytes[1], bytes[2], bytes[3]];
        let count = if self.big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) } as usize;
        // Every element takes a byte at least: a count beyond that is broken, and nothing is allocated for it.
        if count > self.body.len() - self.at {
            return Err(format!("a count of {count} where {} bytes are left", self.body.len() - self.at));
        }
        Ok(count)
    }

    /// Takes down that the bytes between a place and the present one decide the shape of the message.
    fn mark(&self, begin: usize) {
        if let Some(marks) = self.marks {
            marks.borrow_mut().shape.push(begin + HEAD..self.at + HEAD);
        }
    }

    fn text(&mut self) -> Result<&'a [u8], Broken> {
        let count = self.count()?;
        let bytes = self.block(1, count)?;
        Ok(bytes.strip_suffix(&[0]).unwrap_or(bytes))
    }

    fn how_many(&mut self, many: Many) -> Result<usize, Broken> {
        match many {
            Many::One => Ok(1),
            Many::Fixed(count) => Ok(count),
            Many::Listed => self.count(),
        }
    }

    fn message(
        &mut self,
        schema: &Schema,
        message: usize,
        node: Option<&Node>,
        slots: &mut [Slot],
        outputs: &mut [f64],
    ) -> Result<(), Broken> {
        let fields = &schema.messages[message].fields;
        if fields.is_empty() {
            // A structure in C has at least one member; ROS 2 writes one byte for it.
            self.block(1, 1)?;
        }
        let (wanted, lists) = match node {
            Some(Node::Fields { fields, lists }) => (fields.as_slice(), lists.as_slice()),
            _ => (&[][..], &[][..]),
        };
        for (list, filled) in lists {
            let mut ahead = Self { marks: None, ..*self };
            for field in &fields[..*list] {
                ahead.field(schema, field.kind, field.many, None, slots, outputs)?;
            }
            let begin = ahead.at;
            ahead.names(fields[*list].many, filled, slots)?;
            Self { marks: self.marks, ..ahead }.mark(begin);
        }
        let mut wanted = wanted.iter().peekable();
        for (i, field) in fields.iter().enumerate() {
            let node = wanted.next_if(|(index, _)| *index == i).map(|(_, node)| node);
            self.field(schema, field.kind, field.many, node, slots, outputs)?;
        }
        Ok(())
    }

    /// Looks the names of slots up in a list.
    fn names(&mut self, many: Many, filled: &[usize], slots: &mut [Slot]) -> Result<(), Broken> {
        for &slot in filled {
            slots[slot].index = None;
        }
        for i in 0..self.how_many(many)? {
            let name = self.text()?;
            for &slot in filled {
                if slots[slot].index.is_none() && slots[slot].name.as_bytes() == name {
                    slots[slot].index = Some(i);
                }
            }
        }
        Ok(())
    }

    fn field(
        &mut self,
        schema: &Schema,
        kind: Kind,
        many: Many,
        node: Option<&Node>,
        slots: &mut [Slot],
        outputs: &mut [f64],
    ) -> Result<(), Broken> {
        let count = self.how_many(many)?;
        if let Some(size) = kind.size() {
            let bytes = self.block(size, count)?;
            match node {
                Some(Node::Value(places)) => self.put(kind, bytes, 0, places, outputs),
                Some(Node::Items(items)) => {
                    for (item, node) in items {
                        if let (Some(index), Node::Value(places)) = (index_of(*item, slots), node) {
                            self.put(kind, bytes, index, places, outputs);
                        }
                    }
                }
                _ => {}
            }
            return Ok(());
        }
        for i in 0..count {
            match kind {
                Kind::Text => {
                    self.text()?;
                }
                Kind::Message(inner) => {
                    let below = match node {
                        Some(Node::Items(items)) => {
                            items.iter().find(|(item, _)| index_of(*item, slots) == Some(i)).map(|(_, node)| node)
                        }
                        other => other,
                    };
                    self.message(schema, inner, below, slots, outputs)?;
                }
                _ => return Err("a wstring, whose width differs between vendors, is not read".into()),
            }
        }
        Ok(())
    }

    fn put(&self, kind: Kind, block: &[u8], index: usize, places: &[usize], outputs: &mut [f64]) {
        let size = kind.size().unwrap_or(1);
        let Some(bytes) = block.get(index * size..(index + 1) * size) else { return };
        let value = number(kind, bytes, self.big);
        for &place in places {
            outputs[place] = value;
        }
        if let Some(marks) = self.marks {
            // The block ends at the present place.
            let begin = self.at - block.len() + index * size + HEAD;
            marks.borrow_mut().numbers.extend(places.iter().map(|&place| (begin, kind, place)));
        }
    }

    fn leaves(
        &mut self,
        schema: &Schema,
        message: usize,
        path: &mut Vec<Step>,
        names: &[String],
        found: &mut Vec<Leaf>,
    ) -> Result<(), Broken> {
        let fields = &schema.messages[message].fields;
        if fields.is_empty() {
            self.block(1, 1)?;
        }
        let mut own: Vec<String> = Vec::new();
        let mut ahead = *self;
        for field in fields {
            if field.kind == Kind::Text && field.many != Many::One && LISTS.contains(&field.name.as_str()) {
                for _ in 0..ahead.how_many(field.many)? {
                    own.push(String::from_utf8_lossy(ahead.text()?).into_owned());
                }
                break;
            }
            ahead.field(schema, field.kind, field.many, None, &mut [], &mut [])?;
        }
        let names = if own.is_empty() { names } else { &own };
        for field in fields {
            path.push(Step::Field(field.name.clone()));
            let count = self.how_many(field.many)?;
            // Names with brackets or that look like an index can't be part of a path.
            let by_name = count == names.len()
                && names.iter().all(|n| !n.is_empty() && !n.contains(']') && n.parse::<usize>().is_err());
            let mut leaf = |path: &[Step], number| {
                let type_name = schema.type_name(field);
                if found.len() < MOST_LEAVES {
                    found.push(Leaf { path: path.to_vec(), type_name, number });
                }
            };
            let item = |i: usize| Step::Item(if by_name { names[i].clone() } else { i.to_string() });
            match (field.kind, field.kind.size()) {
                (kind, Some(size)) => {
                    self.block(size, count)?;
                    if field.many == Many::One {
                        leaf(path, true);
                    } else if count > SHOWN || kind == Kind::U8 && field.many == Many::Listed {
                        leaf(path, false);
                    } else {
                        for i in 0..count {
                            path.push(item(i));
                            leaf(path, true);
                            path.pop();
                        }
                    }
                }
                (Kind::Message(inner), _) => {
                    for i in 0..count {
                        if field.many != Many::One {
                            path.push(item(i));
                        }
                        if i < SHOWN_MESSAGES || by_name {
                            self.leaves(schema, inner, path, names, found)?;
                        } else {
                            self.message(schema, inner, None, &mut [], &mut [])?;
                        }
                        if field.many != Many::One {
                            path.pop();
                        }
                    }
                }
                _ => {
                    leaf(path, false);
                    for _ in 0..count {
                        if field.kind != Kind::Text {
                            return Err("a wstring, whose width differs between vendors, is not read".into());
                        }
                        self.text()?;
                    }
                }
            }
            path.pop();
        }
        Ok(())
    }
}

fn index_of(item: Item, slots: &[Slot]) -> Option<usize> {
    match item {
        Item::At(index) => Some(index),
        Item::Slot(slot) => slots[slot].index,
    }
}
