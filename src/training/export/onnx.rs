//! The few messages of ONNX that are needed, in protobuf's wire format. Field numbers are those of
//! `onnx.proto3`.

/// Version of the file format; 8 belongs to opset 17.
const IR_VERSION: i64 = 8;
/// Version of the operators.
const OPSET: i64 = 17;
/// `TensorProto.DataType.FLOAT`.
const FLOAT: i64 = 1;
/// `TensorProto.DataType.INT64`.
const INT64: i64 = 7;
/// `AttributeProto.AttributeType`.
const INT: i64 = 2;
const INTS: i64 = 7;

/// A protobuf message under construction.
#[derive(Clone, Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn int(mut self, field: u32, value: i64) -> Self {
        self.varint(u64::from(field) << 3);
        self.varint(value as u64);
        self
    }

    fn bytes(mut self, field: u32, value: &[u8]) -> Self {
        self.varint(u64::from(field) << 3 | 2);
        self.varint(value.len() as u64);
        self.0.extend_from_slice(value);
        self
    }

    fn text(self, field: u32, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }

    fn message(self, field: u32, value: &Self) -> Self {
        self.bytes(field, &value.0)
    }
}

/// An attribute of an operator.
pub enum Attribute<'a> {
    /// A number.
    Int(&'a str, i64),
    /// A list of numbers.
    Ints(&'a str, &'a [usize]),
}

/// A computation graph whose every input and output has the batch as its first dimension.
#[derive(Default)]
pub struct OnnxGraph {
    nodes: Vec<Message>,
    weights: Vec<Message>,
    inputs: Vec<Message>,
    outputs: Vec<Message>,
    /// Names of inputs, which no value and no weight takes.
    taken: Vec<String>,
    values: usize,
    stored: usize,
}

impl OnnxGraph {
    /// Declares an input `[n, dims...]` and returns its name. All inputs come before the first value and the first weight,
    /// which are named so that none has the name of an input, such as that of a camera.
    pub fn input(&mut self, name: &str, dims: &[usize]) -> String {
        self.inputs.push(declaration(name, dims));
        self.taken.push(name.to_owned());
        name.to_owned()
    }

    /// Gives a value the name of an output `[n, dims...]`.
    pub fn output(&mut self, name: &str, value: &str, dims: &[usize]) {
        self.push_node("Identity", &[value], name, &[]);
        self.outputs.push(declaration(name, dims));
    }

    /// Stores constant values and returns their name.
    ///
    /// # Panics
    /// If there are more or fewer values than the shape says.
    pub fn constant(&mut self, dims: &[usize], values: &[f32]) -> String {
        assert_eq!(dims.iter().product::<usize>(), values.len());
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.stored(dims, FLOAT, &raw)
    }

    /// Stores a shape for `Reshape` and returns its name; 0 keeps the dimension.
    pub fn shape(&mut self, dims: &[usize]) -> String {
        let raw: Vec<u8> = dims
            .iter()
            .flat_map(|dim| (*dim as i64).to_le_bytes())
            .collect();
        self.stored(&[dims.len()], INT64, &raw)
    }

    /// A range of a value `[n, m, ...]` along its second axis.
    pub fn columns(&mut self, value: &str, range: std::ops::Range<usize>) -> String {
        let [first, end, axis] = [range.start, range.end, 1].map(|index| self.shape(&[index]));
        self.node("Slice", &[value, &first, &end, &axis], &[])
    }

    fn stored(&mut self, dims: &[usize], kind: i64, raw: &[u8]) -> String {
        let name = next_name('w', &mut self.stored, &self.taken);
        let tensor = dims
            .iter()
            .fold(Message::default(), |m, dim| m.int(1, *dim as i64))
            .int(2, kind)
            .text(8, &name)
            .bytes(9, raw);
        self.weights.push(tensor);
        name
    }

    /// Adds an operator and returns the name of its result.
    pub fn node(
        &mut self,
        operator: &str,
        inputs: &[&str],
        attributes: &[Attribute<'_>],
    ) -> String {
        let result = next_name('v', &mut self.values, &self.taken);
        self.push_node(operator, inputs, &result, attributes);
        result
    }

    fn push_node(
        &mut self,
        operator: &str,
        inputs: &[&str],
        result: &str,
        attributes: &[Attribute<'_>],
    ) {
        let mut node = inputs
            .iter()
            .fold(Message::default(), |m, input| m.text(1, input))
            .text(2, result)
            .text(3, &format!("{operator}_{result}"))
            .text(4, operator);
        for attribute in attributes {
            let message = match attribute {
                Attribute::Int(name, value) => {
                    Message::default().text(1, name).int(3, *value).int(20, INT)
                }
                Attribute::Ints(name, values) => values
                    .iter()
                    .fold(Message::default().text(1, name), |m, v| m.int(8, *v as i64))
                    .int(20, INTS),
            };
            node = node.message(5, &message);
        }
        self.nodes.push(node);
    }

    /// The finished file.
    #[must_use]
    pub fn into_model(self, name: &str) -> Vec<u8> {
        let graph = Message::default();
        let graph = self.nodes.iter().fold(graph, |g, node| g.message(1, node));
        let graph = graph.text(2, name);
        let graph = self.weights.iter().fold(graph, |g, w| g.message(5, w));
        let graph = self.inputs.iter().fold(graph, |g, i| g.message(11, i));
        let graph = self.outputs.iter().fold(graph, |g, o| g.message(12, o));
        let opset = Message::default().text(1, "").int(2, OPSET);
        Message::default()
            .int(1, IR_VERSION)
            .text(2, "catena")
            .message(7, &graph)
            .message(8, &opset)
            .0
    }
}

/// The next of the names that a letter begins, but for those that are taken.
fn next_name(letter: char, count: &mut usize, taken: &[String]) -> String {
    loop {
        let name = format!("{letter}{count}");
        *count += 1;
        if !taken.contains(&name) {
            return name;
        }
    }
}

/// A `ValueInfoProto`: a float tensor whose first dimension is named `n`.
fn declaration(name: &str, dims: &[usize]) -> Message {
    let batch = Message::default().text(2, "n");
    let shape = dims
        .iter()
        .fold(Message::default().message(1, &batch), |shape, dim| {
            shape.message(1, &Message::default().int(1, *dim as i64))
        });
    let tensor = Message::default().int(1, FLOAT).message(2, &shape);
    Message::default()
        .text(1, name)
        .message(2, &Message::default().message(1, &tensor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wire_format_by_hand() {
        let message = Message::default().int(1, 300).text(2, "ab");
        assert_eq!(message.0, [0x08, 0xac, 0x02, 0x12, 0x02, b'a', b'b']);
        assert_eq!(Message::default().int(16, 1).0, [0x80, 0x01, 0x01]);
    }

    #[test]
    fn no_value_and_no_weight_has_the_name_of_an_input() {
        let mut graph = OnnxGraph::default();
        for camera in ["v0", "w1"] {
            graph.input(camera, &[2]);
        }
        let weights = [0.0, 1.0].map(|value| graph.constant(&[1], &[value]));
        assert_eq!(weights, ["w0", "w2"]);
        let values = ["v0", "w1"].map(|input| graph.node("Relu", &[input], &[]));
        assert_eq!(values, ["v1", "v2"]);
    }

    #[test]
    fn names_of_values_are_unique() {
        let mut graph = OnnxGraph::default();
        let x = graph.input("x", &[2]);
        let w = graph.constant(&[2], &[1.0, 2.0]);
        let a = graph.node("Add", &[&x, &w], &[]);
        let b = graph.node("Relu", &[&a], &[]);
        assert_ne!(a, b);
        graph.output("y", &b, &[2]);
        assert!(!graph.into_model("test").is_empty());
    }
}
