use std::time::Duration;

use super::arguments::{Arguments, LimitArguments, ServeArguments};
use super::error::CliError;
use super::loaded::{Loaded, graph_digests, tell_warnings};
use crate::rollout::Controller;
use crate::serve::{ApiKey, PolicyLabel, PolicyService, ServeLimits, Server, Service, Stop};

/// `catena serve`: a composition for whoever connects, until the process is asked to end.
pub(super) fn serve(
    serve_arguments: &ServeArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    // A port that is taken, or a key that is none, is told before anything is loaded.
    let server = server(serve_arguments.bind, &serve_arguments.limits)?;
    let loaded = Loaded::load(&serve_arguments.target, arguments)?;
    let composition = &loaded.composition;
    tell_warnings(composition);
    let planner = loaded.own_planner()?;
    planner.plan_from_start().map_err(CliError::NoPath)?;
    let options = loaded.rollout_options(serve_arguments.nearest_states);
    let controller = Controller::new(loaded.rollout_model(), planner, options)?;
    let label = PolicyLabel {
        name: composition.name.clone(),
        description: composition.description.clone().unwrap_or_default(),
        model: loaded.model.digest(),
        graphs: graph_digests(composition)?,
        engine: loaded.model.engine().name().to_owned(),
    };
    let spec = &loaded.model.manifest().spec;
    let cameras: Vec<String> = spec
        .cameras
        .iter()
        .map(|c| format!("{} {}x{}", c.name, c.height, c.width))
        .collect();
    println!(
        "{}: cameras {}; {}; engine: {}",
        composition.name,
        cameras.join(", "),
        spec.action_space,
        loaded.model.engine().description()
    );
    run(
        server,
        "the policy",
        &PolicyService::new(controller, &label),
    )
}

/// A server that has its port.
pub(super) fn server(
    address: std::net::SocketAddr,
    limits: &LimitArguments,
) -> Result<Server, CliError> {
    let key = limits
        .api_key_file
        .as_deref()
        .map(ApiKey::read)
        .transpose()?;
    let limits = ServeLimits {
        connections: limits.max_connections,
        message_bytes: limits.max_message_mib.saturating_mul(1 << 20),
        idle: Duration::from_secs(limits.idle_secs),
        ..ServeLimits::default()
    };
    Ok(Server::bind(address, key, limits)?)
}

/// Serves until a signal comes. The line that says where is the one that scripts wait for.
pub(super) fn run(server: Server, what: &str, service: &dyn Service) -> Result<(), CliError> {
    let stop = Stop::default();
    server.stop_on_signals(&stop)?;
    println!(
        "serving {what} on ws://{}; Ctrl-C ends it",
        server.address()
    );
    server.run(service, &stop);
    println!("stopped");
    Ok(())
}
