#![no_main]
//! A message of any bytes to a server: a value or a reason, never a panic.

use catena::serve::Message;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(message) = Message::read(data) {
        let arrays = ["head", "wrist", "action"].map(|name| message.get(name));
        for array in arrays.into_iter().flatten() {
            if let Message::Array(array) = array {
                drop(array.values());
            }
        }
    }
});
