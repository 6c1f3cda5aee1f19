//! Just enough of ONNX's protobuf form to write the networks of the tests. Field numbers are those of
//! `onnx.proto3`.

const OPSET: u64 = 17;
const FLOAT: u64 = 1;

/// A network in the making.
#[derive(Default)]
pub struct Network {
    fields: Vec<u8>,
}

impl Network {
    pub fn node(mut self, operator: &str, inputs: &[&str], output: &str) -> Self {
        let mut node = Vec::new();
        for input in inputs {
            bytes(&mut node, 1, input.as_bytes());
        }
        bytes(&mut node, 2, output.as_bytes());
        bytes(&mut node, 4, operator.as_bytes());
        // Every Concat and Flatten of the tests works along the second axis, their other nodes need no
        // attribute.
        if matches!(operator, "Concat" | "Flatten") {
            let mut axis = Vec::new();
            bytes(&mut axis, 1, b"axis");
            integer(&mut axis, 3, 1);
            integer(&mut axis, 20, 2);
            bytes(&mut node, 5, &axis);
        }
        bytes(&mut self.fields, 1, &node);
        self
    }

    pub fn constant(mut self, name: &str, shape: &[usize], values: &[f32]) -> Self {
        let mut tensor = Vec::new();
        for length in shape {
            integer(&mut tensor, 1, *length as u64);
        }
        integer(&mut tensor, 2, FLOAT);
        bytes(&mut tensor, 8, name.as_bytes());
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        bytes(&mut tensor, 9, &raw);
        bytes(&mut self.fields, 5, &tensor);
        self
    }

    /// An input with any number of rows of this shape.
    pub fn input(self, name: &str, row: &[usize]) -> Self {
        self.outlet(11, name, row)
    }

    /// An output with any number of rows of this shape.
    pub fn output(self, name: &str, row: &[usize]) -> Self {
        self.outlet(12, name, row)
    }

    fn outlet(mut self, field: u64, name: &str, row: &[usize]) -> Self {
        let mut shape = Vec::new();
        let mut rows = Vec::new();
        bytes(&mut rows, 2, b"n");
        bytes(&mut shape, 1, &rows);
        for length in row {
            let mut dimension = Vec::new();
            integer(&mut dimension, 1, *length as u64);
            bytes(&mut shape, 1, &dimension);
        }
        let mut tensor = Vec::new();
        integer(&mut tensor, 1, FLOAT);
        bytes(&mut tensor, 2, &shape);
        let mut kind = Vec::new();
        bytes(&mut kind, 1, &tensor);
        let mut outlet = Vec::new();
        bytes(&mut outlet, 1, name.as_bytes());
        bytes(&mut outlet, 2, &kind);
        bytes(&mut self.fields, field, &outlet);
        self
    }

    /// The file.
    pub fn model(mut self) -> Vec<u8> {
        bytes(&mut self.fields, 2, b"test");
        let mut opset = Vec::new();
        bytes(&mut opset, 1, b"");
        integer(&mut opset, 2, OPSET);
        let mut model = Vec::new();
        integer(&mut model, 1, 8);
        bytes(&mut model, 7, &self.fields);
        bytes(&mut model, 8, &opset);
        model
    }
}

fn integer(message: &mut Vec<u8>, field: u64, value: u64) {
    varint(message, field << 3);
    varint(message, value);
}

fn bytes(message: &mut Vec<u8>, field: u64, value: &[u8]) {
    varint(message, field << 3 | 2);
    varint(message, value.len() as u64);
    message.extend_from_slice(value);
}

fn varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}
