//! `do:` as written: a list of tasks, and containers of tasks within it.

use super::reader::{Fields, Reader};
use super::source::Located;
use super::yaml::{Node, Value};
use crate::task::Order;

/// Keys of a container.
const CONTAINERS: &[&str] = &["in_order", "any_order", "choice", "optional", "repeat"];

/// Most times that a part is repeated.
const MAX_TIMES: u32 = 100;

/// Reads `do:`; every task that it names goes to `tasks` as well.
pub(super) fn read_order(
    fields: &Fields<'_>,
    tasks: &mut Vec<Located<String>>,
    reader: &mut Reader<'_>,
) -> Option<Order> {
    let help = "list the tasks to do, in order: 'do: [sock, trash]'";
    let node = reader.required(fields, "do", help)?;
    if matches!(node.value, Value::Map(_)) {
        return read_part(node, tasks, reader);
    }
    read_parts(node, "do", tasks, reader).map(Order::InOrder)
}

fn read_parts(
    node: &Node,
    what: &str,
    tasks: &mut Vec<Located<String>>,
    reader: &mut Reader<'_>,
) -> Option<Vec<Order>> {
    let items = reader.list(node, what)?;
    let parts: Vec<Option<Order>> = items
        .iter()
        .map(|item| read_part(item, tasks, reader))
        .collect();
    parts.into_iter().collect()
}

/// A task, a container, or a list of parts to be done in order.
fn read_part(
    node: &Node,
    tasks: &mut Vec<Located<String>>,
    reader: &mut Reader<'_>,
) -> Option<Order> {
    match &node.value {
        Value::List(_) => read_parts(node, "a list of tasks", tasks, reader).map(Order::InOrder),
        Value::Map(_) => read_container(node, tasks, reader),
        _ => {
            let name = reader.name(node, "the name of a task")?;
            tasks.push(name.clone());
            Some(Order::Task(name.value))
        }
    }
}

fn read_container(
    node: &Node,
    tasks: &mut Vec<Located<String>>,
    reader: &mut Reader<'_>,
) -> Option<Order> {
    let fields = reader.fields(node, "a container of tasks", CONTAINERS)?;
    let given: Vec<(&str, &Node)> = CONTAINERS
        .iter()
        .filter_map(|key| Some((*key, fields.value(key)?)))
        .collect();
    let [(key, value)] = given[..] else {
        // Unknown keys were reported.
        if !given.is_empty() {
            reader.ambiguous(
                node,
                "a container of tasks has one key",
                "begin a new item of the list for each: '- any_order: [trash, wine]'",
            );
        } else if matches!(&node.value, Value::Map(entries) if entries.is_empty()) {
            reader.ambiguous(
                node,
                "a container of tasks has one key, and this one has none",
                "write what is to be done, such as {any_order: [trash, wine]}, or leave the item out",
            );
        }
        return None;
    };
    match key {
        "optional" => {
            let part = read_part(value, tasks, reader)?;
            Some(Order::Optional(Box::new(part)))
        }
        "repeat" => read_repeat(value, tasks, reader),
        "any_order" => read_parts(value, key, tasks, reader).map(Order::AnyOrder),
        "choice" => read_parts(value, key, tasks, reader).map(Order::Choice),
        _ => read_parts(value, key, tasks, reader).map(Order::InOrder),
    }
}

/// `{times: 3, do: [sock]}`.
fn read_repeat(
    node: &Node,
    tasks: &mut Vec<Located<String>>,
    reader: &mut Reader<'_>,
) -> Option<Order> {
    let help = "say how often and what: 'repeat: {times: 3, do: [sock]}'";
    if !matches!(node.value, Value::Map(_) | Value::Reported) {
        let message = format!(
            "repeat must say how often and what, but is {}",
            node.describe()
        );
        reader.ambiguous(node, &message, help);
        return None;
    }
    let fields = reader.fields(node, "repeat", &["times", "do"])?;
    let times = reader
        .required(&fields, "times", help)
        .and_then(|n| reader.integer(n, "times", &(1..=MAX_TIMES)));
    let part = reader
        .required(&fields, "do", help)
        .and_then(|n| read_part(n, tasks, reader));
    Some(Order::Repeat(times?, Box::new(part?)))
}
