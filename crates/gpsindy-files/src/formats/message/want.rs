//! What a task takes from a message: the paths to its numbers, checked against the schema and joined into one tree.

use crate::formats::message::kind::Kind;
use crate::formats::message::layout::Layout;
use crate::formats::message::path::{Step, shown};
use crate::formats::message::schema::{Field, Many, Schema};
use crate::near::hint;

/// Fields that name the elements of the arrays next to and below them.
pub(crate) const LISTS: [&str; 3] = ["name", "names", "joint_names"];

/// Numbers wanted from each message, in the order of their outputs.
#[derive(Debug, Clone)]
pub(crate) struct Wants {
    pub(crate) root: Node,
    /// Names in place of an index.
    pub(crate) slots: Vec<Slot>,
    /// Number of outputs.
    pub(crate) count: usize,
    /// Where they were in the last message.
    pub(crate) layout: Layout,
}

/// A place in a message on the way to what is wanted.
#[derive(Debug, Clone)]
pub(crate) enum Node {
    /// A number, and the outputs that take it.
    Value(Vec<usize>),
    /// A message: its wanted fields in order.
    Fields {
        fields: Vec<(usize, Node)>,
        /// Lists of names in it, and the slots that they fill.
        lists: Vec<(usize, Vec<usize>)>,
    },
    /// An array and its wanted elements.
    Items(Vec<(Item, Node)>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Item {
    At(usize),
    /// The index that a slot holds.
    Slot(usize),
}

/// A name, and its index in the present message's list.
#[derive(Debug, Clone)]
pub(crate) struct Slot {
    pub(crate) name: String,
    pub(crate) index: Option<usize>,
}

impl Wants {
    /// Joins the paths of a message's fields, one output each.
    ///
    /// # Errors
    /// A path that the schema does not have, for the user.
    pub(crate) fn of(schema: &Schema, paths: &[Vec<Step>]) -> Result<Self, String> {
        let mut wants = Self { root: Node::fields(), slots: Vec::new(), count: paths.len(), layout: Layout::default() };
        for (output, path) in paths.iter().enumerate() {
            let route = route(schema, path)?;
            wants.insert(&route, output);
        }
        Ok(wants)
    }

    fn insert(&mut self, route: &[Hop], output: usize) {
        // Lists of names on the way, by the hop at which their message begins.
        let mut named: Vec<(usize, usize, usize)> = Vec::new();
        let mut hops = Vec::with_capacity(route.len());
        for hop in route {
            hops.push(match hop {
                Hop::Field(index) => Way::Field(*index),
                Hop::At(index) => Way::Item(Item::At(*index)),
                Hop::Named { name, level, list } => {
                    // Names in the outermost message's own list are looked up once for all that want them.
                    let known = (*level == 0).then(|| self.root.slots_of(*list)).into_iter().flatten();
                    let known = known.copied().find(|slot| self.slots[*slot].name == *name);
                    let slot = known.unwrap_or_else(|| {
                        self.slots.push(Slot { name: name.clone(), index: None });
                        named.push((*level, *list, self.slots.len() - 1));
                        self.slots.len() - 1
                    });
                    Way::Item(Item::Slot(slot))
                }
            });
        }
        let mut node = &mut self.root;
        for (i, hop) in hops.iter().enumerate() {
            for (level, list, slot) in &named {
                if *level == i {
                    node.add_list(*list, *slot);
                }
            }
            // What follows the hop: the next one says of what kind it is.
            let fresh = match hops.get(i + 1) {
                None => Node::Value(Vec::new()),
                Some(Way::Field(_)) => Node::fields(),
                Some(Way::Item(_)) => Node::Items(Vec::new()),
            };
            node = match (node, hop) {
                (Node::Fields { fields, .. }, Way::Field(index)) => {
                    let at = fields.partition_point(|(f, _)| f < index);
                    if fields.get(at).is_none_or(|(f, _)| f != index) {
                        fields.insert(at, (*index, fresh));
                    }
                    &mut fields[at].1
                }
                (Node::Items(items), Way::Item(item)) => {
                    let at = items.iter().position(|(i, _)| i == item).unwrap_or_else(|| {
                        items.push((*item, fresh));
                        items.len() - 1
                    });
                    &mut items[at].1
                }
                // The schema gives each place one kind.
                (other, _) => other,
            };
        }
        if let Node::Value(outputs) = node {
            outputs.push(output);
        }
    }
}

impl Node {
    fn fields() -> Self {
        Self::Fields { fields: Vec::new(), lists: Vec::new() }
    }

    /// The slots that a list of names in this message fills.
    fn slots_of(&self, list: usize) -> &[usize] {
        let Self::Fields { lists, .. } = self else { return &[] };
        lists.iter().find(|(l, _)| *l == list).map_or(&[], |(_, slots)| slots)
    }

    fn add_list(&mut self, list: usize, slot: usize) {
        let Self::Fields { lists, .. } = self else { return };
        match lists.iter_mut().find(|(l, _)| *l == list) {
            Some((_, slots)) => slots.push(slot),
            None => lists.push((list, vec![slot])),
        }
    }
}

enum Way {
    Field(usize),
    Item(Item),
}

/// A step that was found in the schema.
enum Hop {
    Field(usize),
    At(usize),
    /// By a list of names: the hop at which the list's message begins, and its field there.
    Named {
        name: String,
        level: usize,
        list: usize,
    },
}

fn route(schema: &Schema, path: &[Step]) -> Result<Vec<Hop>, String> {
    let mut hops: Vec<Hop> = Vec::new();
    // Messages on the way: the hop at which each begins.
    let mut within: Vec<(usize, usize)> = vec![(0, 0)];
    let mut steps = path.iter().enumerate().peekable();
    while let Some((i, step)) = steps.next() {
        let (_, message) = within[within.len() - 1];
        let here = &schema.messages[message];
        let Step::Field(name) = step else {
            return Err(format!("`{}` is a message, {}; name a field of it", shown(&path[..i]), here.name));
        };
        let Some(index) = here.fields.iter().position(|f| f.name == *name) else {
            let found = hint(name, here.fields.iter().map(|f| f.name.as_str()));
            return Err(format!("there is no field `{name}` in {}{found}", here.name));
        };
        let field = &here.fields[index];
        hops.push(Hop::Field(index));
        let so_far = shown(&path[..=i]);
        if field.many != Many::One {
            let list = list_of(schema, &within);
            let Some((_, Step::Item(item))) = steps.next_if(|(_, s)| matches!(s, Step::Item(_))) else {
                let by_name = list.map_or(String::new(), |_| format!(", or `{so_far}[NAME]` by its list of names"));
                return Err(format!(
                    "`{so_far}` is {}; name an element, `{so_far}[0]`{by_name}",
                    schema.type_name(field)
                ));
            };
            hops.push(hop_of(schema, field, item, &so_far, list)?);
        } else if let Some((_, Step::Item(_))) = steps.peek() {
            return Err(format!("`{so_far}` is one {}, not an array; remove the brackets", schema.type_name(field)));
        }
        match field.kind {
            Kind::Message(inner) if steps.peek().is_none() => {
                let names: Vec<&str> = schema.messages[inner].fields.iter().map(|f| f.name.as_str()).collect();
                let inner = &schema.messages[inner].name;
                return Err(format!("`{so_far}` is a message, {inner}; name a field of it: {}", names.join(", ")));
            }
            Kind::Message(inner) => within.push((hops.len(), inner)),
            Kind::Text | Kind::WideText => return Err(format!("`{so_far}` is text, not a number")),
            _ if steps.peek().is_some() => {
                return Err(format!("`{so_far}` is {}; it has no fields", schema.type_name(field)));
            }
            _ => {}
        }
    }
    Ok(hops)
}

fn hop_of(
    schema: &Schema,
    field: &Field,
    item: &str,
    so_far: &str,
    list: Option<(usize, usize)>,
) -> Result<Hop, String> {
    if let Ok(at) = item.parse::<usize>() {
        return match field.many {
            Many::Fixed(count) if at >= count => {
                Err(format!("`{so_far}` is {}; its last element is `{so_far}[{}]`", schema.type_name(field), count - 1))
            }
            _ => Ok(Hop::At(at)),
        };
    }
    match list {
        Some((level, list)) => Ok(Hop::Named { name: item.into(), level, list }),
        None => Err(format!("no list of names goes with `{so_far}`; name the element by its index, `{so_far}[0]`")),
    }
}

/// The list of names of the innermost message that has one: the hop at which that message begins, and the field.
fn list_of(schema: &Schema, within: &[(usize, usize)]) -> Option<(usize, usize)> {
    let is_list = |f: &Field| f.kind == Kind::Text && f.many != Many::One;
    within.iter().rev().find_map(|&(level, message)| {
        let fields = &schema.messages[message].fields;
        let usual = LISTS.iter().find_map(|name| fields.iter().position(|f| f.name == *name && is_list(f)));
        let only = || {
            let mut lists = fields.iter().enumerate().filter(|(_, f)| is_list(f));
            lists.next().filter(|_| lists.next().is_none()).map(|(i, _)| i)
        };
        usual.or_else(only).map(|list| (level, list))
    })
}
