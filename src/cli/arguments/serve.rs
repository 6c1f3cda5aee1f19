//! Commands that wait for a program elsewhere.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use super::{LevelArgument, positive};

/// `catena serve`
#[derive(Debug, Args)]
pub struct ServeArguments {
    /// The composition: its YAML file, its name, or a task's name.
    pub target: String,
    /// The address to listen on.
    #[arg(long, default_value = "127.0.0.1:8000")]
    pub bind: SocketAddr,
    #[command(flatten)]
    pub limits: LimitArguments,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all: for large graphs.
    #[arg(long, value_parser = positive)]
    pub nearest_states: Option<usize>,
}

/// `catena simulate`
#[derive(Debug, Args)]
pub struct SimulateArguments {
    /// The composition (its YAML file, its name, or a task's name): where the robot starts, and which subgoals are judged.
    pub target: String,
    /// The address to listen on.
    #[arg(long, default_value = "127.0.0.1:8001")]
    pub bind: SocketAddr,
    #[command(flatten)]
    pub limits: LimitArguments,
    /// How much the world varies.
    #[arg(long, value_enum, default_value_t = LevelArgument::Paper)]
    pub level: LevelArgument,
}

/// Who may come in, and what each may take.
#[derive(Debug, Args)]
pub struct LimitArguments {
    /// A file with the key that clients must send (`api_key` of openpi-client). Needed where other machines
    /// reach the address.
    #[arg(long, value_name = "FILE")]
    pub api_key_file: Option<PathBuf>,
    /// Connections at a time.
    #[arg(long, default_value_t = 64, value_parser = connections)]
    pub max_connections: usize,
    /// Mebibytes of a message.
    #[arg(long, default_value_t = 32, value_parser = at_least_one::<usize>)]
    pub max_message_mib: usize,
    /// A connection that sends nothing for so many seconds is closed.
    #[arg(long, default_value_t = 600, value_parser = at_least_one::<u64>)]
    pub idle_secs: u64,
}

/// Each has a thread while it is in conversation, and no machine has more of them.
const MAX_CONNECTIONS: usize = 65_536;

/// How many connections there may be at a time.
fn connections(text: &str) -> Result<usize, String> {
    let connections = text.parse().ok();
    let connections = connections.filter(|c: &usize| (1..=MAX_CONNECTIONS).contains(c));
    connections.ok_or_else(|| format!("give a whole number within 1..={MAX_CONNECTIONS}"))
}

/// A whole number that is not 0.
fn at_least_one<N: FromStr + PartialOrd + From<u8>>(text: &str) -> Result<N, String> {
    let number = text.parse().ok().filter(|n: &N| *n >= N::from(1));
    number.ok_or_else(|| "give a whole number from 1".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_are_at_least_one_and_no_more_than_there_can_be() {
        assert_eq!(connections("1"), Ok(1));
        assert_eq!(connections("65536"), Ok(65_536));
        for wrong in ["0", "65537", "18446744073709551615", "-1", "many"] {
            let said = connections(wrong).unwrap_err();
            assert!(said.contains("1..=65536"), "{said}");
        }
    }

    #[test]
    fn limits_with_which_no_client_is_served_are_refused() {
        assert_eq!(at_least_one::<u64>("1"), Ok(1));
        for wrong in ["0", "-1", "some"] {
            let said = at_least_one::<usize>(wrong).unwrap_err();
            assert!(said.contains("from 1"), "{said}");
        }
    }
}
