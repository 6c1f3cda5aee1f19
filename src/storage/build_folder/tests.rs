use super::*;
use crate::graph::fakes::{Oracle, add_demonstration, forward, task};
use crate::graph::{BuildOptions, PairCandidates, ScoreError, score_pairs};
use crate::storage::{load_graph, save_graph};
use crate::task::Task;

const D_MAX: usize = 5;

fn oracle() -> Oracle {
    Oracle::new(D_MAX, forward)
}

fn walk() -> Task {
    task("walk", &["there"])
}

fn states() -> TopologicalGraph {
    let mut graph = TopologicalGraph::new(1, D_MAX);
    for aside in 0..6 {
        let places: Vec<Vec<f32>> = (0..20)
            .map(|x| vec![x as f32 + 0.05 * aside as f32])
            .collect();
        add_demonstration(&mut graph, &walk(), &aside.to_string(), &places, &[19]);
    }
    graph
}

fn options(candidates: PairCandidates) -> BuildOptions {
    BuildOptions {
        candidates,
        part_pairs: 900,
        ..BuildOptions::default()
    }
}

fn manifest(options: &BuildOptions) -> GraphManifest {
    let options = serde_json::to_value(options).expect("options are JSON");
    GraphManifest::new(&[walk()], "model", "demonstrations", options)
}

/// A sink that fails after some parts, as a kill would.
struct Killed<'a> {
    folder: &'a mut BuildFolder,
    parts_left: usize,
}

impl EdgeSink for Killed<'_> {
    type Error = String;

    fn kept_pairs(&self, part: usize) -> Option<u64> {
        self.folder.kept_pairs(part)
    }

    fn keep(&mut self, part: usize, edges: JoinedEdges, pairs: u64) -> Result<(), String> {
        if self.parts_left == 0 {
            return Err("killed".to_owned());
        }
        self.parts_left -= 1;
        self.folder
            .keep(part, edges, pairs)
            .map_err(|e| e.to_string())
    }
}

/// The bytes of the tables of a graph that is built by way of files, killed after some parts.
fn built(candidates: PairCandidates, killed_after: Option<usize>) -> (Vec<Vec<u8>>, u64) {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let options = options(candidates);
    let manifest = manifest(&options);
    let graph = states();
    if let Some(parts_left) = killed_after {
        let mut folder = BuildFolder::open(&target, &manifest, options.part_pairs).expect("opens");
        folder.keep_states(&graph).expect("states are kept");
        let mut sink = Killed {
            folder: &mut folder,
            parts_left,
        };
        let killed = score_pairs(&graph, &oracle(), &options, &mut sink, &|_| ());
        assert!(matches!(killed, Err(ScoreError::Sink(e)) if e == "killed"));
    }
    let mut folder = BuildFolder::open(&target, &manifest, options.part_pairs).expect("opens");
    assert_eq!(folder.kept_parts(), killed_after.unwrap_or(0));
    let kept = folder.states().expect("what was kept can be read");
    let states = kept.unwrap_or_else(|| {
        folder.keep_states(&graph).expect("states are kept");
        graph.clone()
    });
    let oracle = oracle();
    let report = score_pairs(&states, &oracle, &options, &mut folder, &|_| ()).expect("it scores");
    let asked = oracle.pairs.load(std::sync::atomic::Ordering::Relaxed);
    let kept = folder.folder().to_owned();
    let mut complete = manifest.clone();
    complete.scoring = Some(report);
    folder
        .finish(&states, &complete, std::iter::empty())
        .expect("the graph is put together");
    assert!(!kept.exists(), "what was kept is of no more use");
    let (loaded, loaded_manifest) = load_graph(&target).expect("the graph is whole");
    assert_eq!(loaded.edge_count(), loaded_manifest.edge_count);
    assert_eq!(loaded_manifest.scoring, Some(report));
    let read = |name| fs::read(target.join(name)).expect("a table");
    (vec![read("nodes.parquet"), read("edges.parquet")], asked)
}

/// The same graph, built and saved in memory.
fn in_memory(candidates: PairCandidates) -> Vec<Vec<u8>> {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let options = options(candidates);
    let mut graph = states();
    let mut edges = JoinedEdges::new();
    let scored = score_pairs(&graph, &oracle(), &options, &mut edges, &|_| ());
    scored.expect("memory holds everything");
    assert!(edges.len() > 100);
    for (from, to, edge) in edges {
        graph.push_edge(from, to, edge);
    }
    save_graph(&target, &graph, &manifest(&options)).expect("saved");
    let read = |name| fs::read(target.join(name)).expect("a table");
    vec![read("nodes.parquet"), read("edges.parquet")]
}

const NEAREST: PairCandidates = PairCandidates::Nearest {
    share: 0.3,
    sample: 0.4,
};

#[test]
fn build_by_way_of_files_gives_the_bytes_of_one_in_memory() {
    for candidates in [PairCandidates::All, NEAREST] {
        assert_eq!(built(candidates, None).0, in_memory(candidates));
    }
}

#[test]
fn killed_build_goes_on_where_it_was_and_gives_the_same() {
    for candidates in [PairCandidates::All, NEAREST] {
        let (whole, all_pairs) = built(candidates, None);
        let (resumed, pairs) = built(candidates, Some(3));
        assert_eq!(resumed, whole);
        assert!(pairs < all_pairs, "{pairs} of {all_pairs} asked again");
    }
}

#[test]
fn build_of_something_else_begins_anew() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let options = options(PairCandidates::All);
    let first = manifest(&options);
    let mut folder = BuildFolder::open(&target, &first, 900).expect("opens");
    folder.keep_states(&states()).expect("states are kept");
    folder.keep(0, Vec::new(), 17).expect("a part is kept");
    drop(folder);
    let reopened = BuildFolder::open(&target, &first, 900).expect("opens");
    assert_eq!(reopened.kept_pairs(0), Some(17));
    drop(reopened);
    let mut other = first.clone();
    other.model_digest = "another".to_owned();
    for (manifest, part_pairs) in [(&first, 901), (&other, 900)] {
        BuildFolder::open(&target, &first, 900)
            .expect("opens")
            .keep_states(&states())
            .expect("states are kept");
        let folder = BuildFolder::open(&target, manifest, part_pairs).expect("opens");
        assert_eq!(folder.kept_pairs(0), None);
        assert!(folder.states().expect("nothing to read").is_none());
    }
}

#[test]
fn part_that_is_not_what_was_kept_is_named() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let options = options(PairCandidates::All);
    let manifest = manifest(&options);
    let graph = states();
    let mut folder = BuildFolder::open(&target, &manifest, 900).expect("opens");
    folder.keep_states(&graph).expect("states are kept");
    score_pairs(&graph, &oracle(), &options, &mut folder, &|_| ()).expect("it scores");
    let part = folder.part_file(1);
    fs::copy(folder.part_file(0), &part).expect("another part in its place");
    let refused = folder
        .finish(&graph, &manifest, std::iter::empty())
        .expect_err("rows are there twice");
    let said = refused.to_string();
    assert!(said.contains("edges-00001.parquet"), "{said}");
    assert!(!target.exists(), "no graph that is not whole");
}

#[test]
fn two_builds_of_one_graph_keep_out_of_each_others_way() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let first = manifest(&options(PairCandidates::All));
    let mut other = first.clone();
    other.model_digest = "another".to_owned();
    let mut folder = BuildFolder::open(&target, &first, 900).expect("opens");
    folder.keep(0, Vec::new(), 17).expect("a part is kept");
    // One of something else would begin by emptying the folder.
    for manifest in [&first, &other] {
        let refused = BuildFolder::open(&target, manifest, 900).expect_err("one is at work");
        let said = refused.to_string();
        assert!(
            said.contains("walk.build") && said.contains("another name"),
            "{said}"
        );
    }
    drop(folder);
    let folder = BuildFolder::open(&target, &first, 900).expect("opens");
    assert_eq!(folder.kept_pairs(0), Some(17), "nothing was lost");
    drop(folder);
    // Emptied, it still keeps others out.
    let folder = BuildFolder::open(&target, &other, 900).expect("opens");
    assert_eq!(folder.kept_pairs(0), None);
    BuildFolder::open(&target, &other, 900).expect_err("one is at work");
}

#[test]
fn nothing_but_a_build_is_deleted() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let manifest = manifest(&options(PairCandidates::All));
    let folder = place.path().join("walk.build");
    let precious = folder.join("thesis.tex");
    fs::create_dir(&folder).expect("a folder of somebody else's");
    fs::write(&precious, "years").expect("written");
    let refused = BuildFolder::open(&target, &manifest, 900).expect_err("it is no build");
    let said = refused.to_string();
    assert!(
        said.contains("walk.build holds thesis.tex") && said.contains("another name"),
        "{said}"
    );
    assert_eq!(fs::read_to_string(&precious).expect("still there"), "years");
    fs::remove_file(&precious).expect("removed");
    for leftover in [
        "build.json",
        ".build.json.tmp",
        "nodes.parquet",
        "temporal.parquet",
        "edges-00012.parquet",
        ".edges-00013.parquet.tmp",
    ] {
        fs::write(folder.join(leftover), "half").expect("written");
    }
    BuildFolder::open(&target, &manifest, 900).expect("leftovers of builds are of no use");
    assert!(!folder.join("edges-00012.parquet").exists());
    fs::write(folder.join("edges-notes.parquet"), "years").expect("written");
    BuildFolder::open(&target, &manifest, 900).expect_err("no part is called so");
}

#[cfg(unix)]
#[test]
fn build_that_cannot_be_read_is_not_deleted() {
    let place = tempfile::tempdir().expect("a temporary folder");
    let target = place.path().join("walk");
    let manifest = manifest(&options(PairCandidates::All));
    let build = BuildFolder::open(&target, &manifest, 900).expect("opens");
    let progress = build.folder().join("build.json");
    fs::remove_file(&progress).expect("removed");
    // A link to itself can be read by nobody, not even by root.
    std::os::unix::fs::symlink("build.json", &progress).expect("a link");
    let part = build.folder().join("edges-00000.parquet");
    fs::write(&part, "hours").expect("written");
    drop(build);
    let refused = BuildFolder::open(&target, &manifest, 900).expect_err("it cannot be read");
    let said = refused.to_string();
    assert!(
        said.contains("cannot read") && said.contains("build.json"),
        "{said}"
    );
    assert!(part.exists());
}
