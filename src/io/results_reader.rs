//! Reads a results file back: every series by path with its texts, block by block.
//!
//! The file is not trusted more than a modal file is: the guard of the modal reader stands before every read.

use super::array::GuardedDataset;
use super::error::ModalFileError;
use super::guard::GuardedFile;
use super::results_file::ResultsError;
use nalgebra::DMatrix;
use std::ops::Range;
use std::path::Path;

/// Name of the schema that this reader knows, and its major version.
pub const FORMAT: &str = "pliant-results";
const MAJOR_VERSION: &str = "1";
/// Texts that a series may carry.
const TEXTS: [&str; 5] = ["unit", "frame", "point", "side", "components"];

/// One time history of a results file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Series {
    /// Path without leading slash; names in it are escaped.
    pub path: String,
    /// Numbers per output time; none for a plain number.
    pub width: Option<usize>,
    /// Texts by name, those that are there.
    pub texts: Vec<(&'static str, String)>,
}

impl Series {
    /// A text by name.
    #[must_use]
    pub fn text(&self, name: &str) -> Option<&str> {
        self.texts.iter().find(|(found, _)| *found == name).map(|(_, text)| text.as_str())
    }
}

/// A modal file that the run used.
#[derive(Debug, Clone, PartialEq)]
pub struct UsedModalFile {
    /// Name of the body as a step of a path, escaped.
    pub body: String,
    /// Path at the time of the run.
    pub path: String,
    /// Digest of its content.
    pub content_sha256: String,
    /// Residual modes over all modes of the file, one column each; none without.
    pub residual_modes: Option<DMatrix<f64>>,
}

/// An open results file.
#[derive(Debug)]
pub struct ResultsReader {
    file: GuardedFile,
    /// Every series, in the order of their paths, the time first.
    pub series: Vec<Series>,
    /// Name of the scene.
    pub scene_name: String,
    /// Modal files of the run.
    pub modal_files: Vec<UsedModalFile>,
    /// Output times in the file.
    pub rows: usize,
}

impl ResultsReader {
    /// Opens the file and lists its series.
    ///
    /// # Errors
    /// If it cannot be opened, is no results file, or a series does not have one row per output time.
    pub fn open(path: &Path) -> Result<Self, ResultsError> {
        let file = GuardedFile::open_whole_chunks(path).map_err(|e| failure(path, e))?;
        Self::list(file).map_err(|e| failure(path, e))
    }

    fn list(file: GuardedFile) -> Result<Self, ModalFileError> {
        let refuse = |object: &str, found: &str, expected: &str| ModalFileError::WrongValue {
            file: file.path().to_owned(),
            object: object.to_owned(),
            found: format!("\"{found}\""),
            expected: expected.to_owned(),
            remedy: "name a file that pliant run --out has written",
        };
        let format = file.text("", "format")?;
        if format != FORMAT {
            return Err(refuse("@format", &format, FORMAT));
        }
        let version = file.text("", "version")?;
        if version.split('.').next() != Some(MAJOR_VERSION) {
            return Err(refuse("@version", &version, "1.x"));
        }
        let scene_name = file.text("", "scene_name")?;
        let rows = file.dataset("time")?.expect_shape(&[None], "one number per output time")?.len();
        let mut series = Vec::new();
        let paths = file.dataset_paths().filter(|path| *path != "time" && !path.starts_with("scene/"));
        for path in std::iter::once("time").chain(paths) {
            let dataset = file.dataset(path)?;
            let width = if dataset.shape.len() > 1 { Some(dataset.shape[1]) } else { None };
            let mut shape = vec![Some(rows)];
            shape.extend(width.map(Some));
            dataset.expect_shape(&shape, "one row per output time")?;
            let mut texts = Vec::new();
            for name in TEXTS {
                match file.text(path, name) {
                    Ok(text) => texts.push((name, text)),
                    Err(ModalFileError::Missing { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
            series.push(Series { path: path.to_owned(), width, texts });
        }
        const USED: &str = "scene/modal_files";
        let used = |body: &str| {
            let group = format!("{USED}/{body}");
            let (path, content_sha256) = (file.text(&group, "path")?, file.text(&group, "content_sha256")?);
            let residual = format!("{group}/residual_modes");
            let residual_modes = if file.has(&residual) {
                let dataset = file.dataset(&residual)?.expect_shape(&[None, None], "(modes of the file, residual modes)")?;
                let (rows, columns) = (dataset.shape[0], dataset.shape[1]);
                Some(DMatrix::from_row_slice(rows, columns, &dataset.read_f64()?))
            } else {
                None
            };
            Ok(UsedModalFile { body: body.to_owned(), path, content_sha256, residual_modes })
        };
        let modal_files = file.children(USED).into_iter().map(used).collect::<Result<_, ModalFileError>>()?;
        Ok(Self { series, scene_name, modal_files, rows, file })
    }

    /// The path as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Names directly under a group, escaped.
    #[must_use]
    pub fn children(&self, group: &str) -> Vec<&str> {
        self.file.children(group)
    }

    /// A series by path.
    #[must_use]
    pub fn find(&self, path: &str) -> Option<&Series> {
        self.series.iter().find(|series| series.path == path)
    }

    /// A series of this width opened for reading in blocks.
    ///
    /// # Errors
    /// If it is not in the file or has another width.
    pub fn column(&self, path: &str, width: Option<usize>) -> Result<Column<'_>, ResultsError> {
        let mut shape = vec![Some(self.rows)];
        shape.extend(width.map(Some));
        let dataset = self.file.dataset(path).and_then(|dataset| dataset.expect_shape(&shape, "one row per output time"));
        dataset.map(|dataset| Column { dataset }).map_err(|e| failure(self.path(), e))
    }
}

/// A series that is read in blocks.
#[derive(Debug)]
pub struct Column<'r> {
    dataset: GuardedDataset<'r>,
}

impl Column<'_> {
    /// Some rows in C order, all of them finite.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn read(&self, rows: Range<usize>) -> Result<Vec<f64>, ResultsError> {
        self.dataset.read_real_rows(rows).map_err(|e| failure(self.dataset.file.path(), e))
    }
}

/// The words of the modal reader, less those that speak of its schema.
fn failure(path: &Path, error: ModalFileError) -> ResultsError {
    let fault = match error {
        ModalFileError::Open { cause, .. } => format!("cannot be opened: {cause}"),
        ModalFileError::Missing { object, expected, .. } => format!("{object}: found nothing, expected {expected}"),
        ModalFileError::WrongShape { object, found, expected, .. } => format!("{object}: found shape {found}, expected {expected}"),
        ModalFileError::WrongValue { object, found, expected, .. } => format!("{object}: found {found}, expected {expected}"),
        ModalFileError::NotFinite { object, index, value, .. } => {
            format!("{object}: found {value} at flat index {index}, expected finite numbers")
        }
        ModalFileError::Unreadable { object, cause, .. } => format!("{object}: found unreadable data ({cause}), expected whole data"),
        other => {
            let text = other.to_string();
            text.strip_prefix(&format!("{}: ", path.display())).map_or(text.clone(), str::to_owned)
        }
    };
    ResultsError::Read { cause: format!("{}: {fault}", path.display()) }
}
