//! What makes a folder of tables a dataset: tasks, episodes, features.

use std::sync::Arc;

use arrow::array::{ArrayRef, Int64Array, ListBuilder, StringArray, StringBuilder};
use arrow::datatypes::{DataType, Field, Schema};
use parquet::file::metadata::KeyValue;
use serde_json::{Value, json};

use super::columns::{image_key, width};
use super::tables::write_table;
use super::{ACTION, CHUNK_FILES, DatasetWriter, EpisodeRow, FILE_BYTES};
use crate::storage::StorageError;
use crate::trajectory::ActionSpace;

impl DatasetWriter {
    pub(super) fn info(&self) -> Value {
        let mut features = serde_json::Map::new();
        let number = |dtype: &str| json!({ "dtype": dtype, "shape": [1], "names": null });
        for camera in &self.cameras {
            let feature = json!({
                "dtype": "image",
                "shape": [camera.height, camera.width, 3],
                "names": ["height", "width", "channels"],
            });
            features.insert(image_key(&camera.name), feature);
        }
        let names = match &self.space {
            ActionSpace::Primitives { names } | ActionSpace::Continuous { names } => names.clone(),
            ActionSpace::Binned { .. } => Vec::new(),
        };
        let action = json!({ "dtype": "float32", "shape": [width(&self.space)], "names": names });
        features.insert(ACTION.to_owned(), action);
        features.insert("timestamp".to_owned(), number("float32"));
        for key in ["frame_index", "episode_index", "index", "task_index"] {
            features.insert(key.to_owned(), number("int64"));
        }
        json!({
            "codebase_version": "v3.0",
            "robot_type": self.robot,
            "total_episodes": self.episodes.len(),
            "total_frames": self.frames,
            "total_tasks": self.tasks.len(),
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": FILE_BYTES >> 20,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": { "train": format!("0:{}", self.episodes.len()) },
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": null,
            "features": features,
        })
    }

    /// Tasks as pandas writes a table that is indexed by them.
    pub(super) fn write_tasks(&self) -> Result<(), StorageError> {
        let index = "__index_level_0__";
        let pandas = json!({
            "index_columns": [index],
            "column_indexes": [{
                "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object",
                "metadata": { "encoding": "UTF-8" },
            }],
            "columns": [
                { "name": "task_index", "field_name": "task_index", "pandas_type": "int64",
                  "numpy_type": "int64", "metadata": null },
                { "name": null, "field_name": index, "pandas_type": "unicode", "numpy_type": "object",
                  "metadata": null },
            ],
            "creator": { "library": "catena", "version": env!("CARGO_PKG_VERSION") },
            "pandas_version": "2.0.0",
        });
        let schema = Schema::new(vec![
            Field::new("task_index", DataType::Int64, true),
            Field::new(index, DataType::Utf8, true),
        ]);
        let numbers: Vec<i64> = (0..self.tasks.len() as i64).collect();
        let columns: Vec<ArrayRef> = vec![
            Arc::new(Int64Array::from(numbers)),
            Arc::new(StringArray::from_iter_values(&self.tasks)),
        ];
        // pyarrow looks for it in the schema that Arrow keeps, others among the notes of the file.
        let schema = schema.with_metadata([("pandas".to_owned(), pandas.to_string())].into());
        let note = KeyValue::new("pandas".to_owned(), pandas.to_string());
        write_table(
            &self.folder.join("meta/tasks.parquet"),
            schema,
            columns,
            Some(note),
        )
    }

    pub(super) fn write_episodes(&self) -> Result<(), StorageError> {
        let text = Arc::new(Field::new_list_field(DataType::Utf8, true));
        let mut tasks = ListBuilder::new(StringBuilder::new());
        for episode in &self.episodes {
            tasks.values().append_value(&self.tasks[episode.task]);
            tasks.append(true);
        }
        let numbers = |of: fn(&EpisodeRow) -> u64| -> ArrayRef {
            Arc::new(
                self.episodes
                    .iter()
                    .map(|e| Some(of(e) as i64))
                    .collect::<Int64Array>(),
            )
        };
        let indices: Int64Array = (0..self.episodes.len() as i64).map(Some).collect();
        let columns: Vec<(&str, ArrayRef)> = vec![
            ("episode_index", Arc::new(indices)),
            ("tasks", Arc::new(tasks.finish())),
            ("length", numbers(|e| e.length)),
            ("data/chunk_index", numbers(|e| e.file / CHUNK_FILES)),
            ("data/file_index", numbers(|e| e.file % CHUNK_FILES)),
            ("dataset_from_index", numbers(|e| e.from)),
            ("dataset_to_index", numbers(|e| e.from + e.length)),
            ("meta/episodes/chunk_index", numbers(|_| 0)),
            ("meta/episodes/file_index", numbers(|_| 0)),
        ];
        let field = |name: &str| match name {
            "tasks" => Field::new(name, DataType::List(Arc::clone(&text)), true),
            _ => Field::new(name, DataType::Int64, true),
        };
        let schema = Schema::new(columns.iter().map(|(n, _)| field(n)).collect::<Vec<_>>());
        let columns = columns.into_iter().map(|(_, c)| c).collect();
        let path = self.folder.join("meta/episodes/chunk-000/file-000.parquet");
        write_table(&path, schema, columns, None)
    }
}
