//! XML as a small tree within fixed bounds.
//!
//! quick-xml hands out one event at a time and never expands an entity, so that neither entity bombs nor deep nesting cost anything
//! before they are refused here: nesting, elements, attributes of an element and the file's size are bounded, and a document type
//! that declares anything of its own is refused.

use super::error::{ImportError, printable, refused};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::path::Path;

/// Largest XML text (bytes).
pub(super) const TEXT_LIMIT: usize = 64 << 20;
/// Most elements; a series has about ten a mode.
const ELEMENT_LIMIT: usize = 200_000;
/// Deepest nesting.
const DEPTH_LIMIT: usize = 32;
/// Most attributes of one element.
const ATTRIBUTE_LIMIT: usize = 32;
const REPAIR: &str = "export the file again";

/// One element.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Element {
    /// Name without prefix.
    pub name: String,
    /// Attributes with their values, names without prefix.
    pub attributes: Vec<(String, String)>,
    /// Numbers of the elements directly below.
    pub children: Vec<usize>,
    /// Text directly below.
    pub text: String,
}

/// All elements in document order; the root is number 0.
#[derive(Debug, PartialEq)]
pub(super) struct Document {
    elements: Vec<Element>,
}

impl Element {
    /// Value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

impl Document {
    /// The root element.
    pub fn root(&self) -> &Element {
        &self.elements[0]
    }

    /// Elements of that name directly below.
    pub fn below<'d>(&'d self, element: &'d Element, name: &'d str) -> impl Iterator<Item = &'d Element> {
        self.children(element).filter(move |child| child.name == name)
    }

    /// Elements directly below.
    pub fn children<'d>(&'d self, element: &'d Element) -> impl Iterator<Item = &'d Element> {
        element.children.iter().map(|&child| &self.elements[child])
    }

    /// All elements of that name.
    pub fn named<'d>(&'d self, name: &'d str) -> impl Iterator<Item = &'d Element> {
        self.elements.iter().filter(move |element| element.name == name)
    }
}

/// Parses a text; `file` is for messages.
pub(super) fn parse(file: &Path, text: &str) -> Result<Document, ImportError> {
    let mut reader = Reader::from_str(text);
    let mut elements: Vec<Element> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    loop {
        let at = reader.buffer_position() as usize;
        let fault = |found: String, expected: &str, remedy: &str| refused(file, place(text, at), found, expected, remedy);
        let event = reader.read_event().map_err(|error| fault(printable(&error.to_string()), "well-formed XML", REPAIR))?;
        match event {
            Event::Start(tag) => {
                let number = add(&tag, &mut elements, &open).map_err(|f| fault(f.0, f.1, REPAIR))?;
                open.push(number);
            }
            Event::Empty(tag) => {
                add(&tag, &mut elements, &open).map_err(|f| fault(f.0, f.1, REPAIR))?;
            }
            Event::End(_) => {
                open.pop();
            }
            Event::Text(content) => append(&mut elements, &open, &content),
            Event::CData(content) => append(&mut elements, &open, &content),
            Event::GeneralRef(name) => {
                let found = format!("the entity \"{}\"", printable(&String::from_utf8_lossy(&name)));
                return Err(fault(found, "text without entities", "write the text itself; entities are not expanded"));
            }
            // the usual line names an external subset, which is not read; anything between brackets could only be declarations
            Event::DocType(content) if declares(&content) => {
                let remedy = "remove the declarations; entities are not expanded";
                return Err(fault("a document type with declarations".to_owned(), "none, or only a name", remedy));
            }
            Event::DocType(_) | Event::Decl(_) | Event::PI(_) | Event::Comment(_) => {}
            Event::Eof => break,
        }
    }
    if elements.is_empty() {
        return Err(refused(file, "the file", "no element", "an Xdmf element", REPAIR));
    }
    match open.last() {
        None => Ok(Document { elements }),
        Some(&number) => {
            let found = format!("the end of the file inside \"{}\"", printable(&elements[number].name));
            Err(refused(file, "the file", found, "a closed element", "export the file again; it was cut short"))
        }
    }
}

/// True for `[ ... ]` with something inside.
fn declares(content: &[u8]) -> bool {
    content.iter().position(|&b| b == b'[').is_some_and(|start| content[start + 1..].iter().any(|&b| b != b']' && !b.is_ascii_whitespace()))
}

/// A new element below the innermost open one.
fn add(tag: &BytesStart<'_>, elements: &mut Vec<Element>, open: &[usize]) -> Result<usize, (String, &'static str)> {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if elements.len() >= ELEMENT_LIMIT {
        return Err((format!("more than {ELEMENT_LIMIT} elements"), "fewer elements; numbers belong in one DataItem"));
    }
    if open.len() >= DEPTH_LIMIT {
        return Err((format!("elements more than {DEPTH_LIMIT} deep"), "the few levels of XDMF"));
    }
    if open.is_empty() && !elements.is_empty() {
        return Err(("a second root element".to_owned(), "one Xdmf element"));
    }
    let mut element = Element { name: text(tag.local_name().as_ref()), ..Element::default() };
    // the check for duplicates would be quadratic in their number
    for attribute in tag.attributes().with_checks(false) {
        if element.attributes.len() >= ATTRIBUTE_LIMIT {
            return Err((format!("more than {ATTRIBUTE_LIMIT} attributes of one element"), "the few attributes of XDMF"));
        }
        let attribute = attribute.map_err(|error| (printable(&error.to_string()), "attributes NAME=\"VALUE\""))?;
        let value = attribute.unescape_value().map_err(|error| (printable(&error.to_string()), "values without entities"))?;
        element.attributes.push((text(attribute.key.local_name().as_ref()), value.into_owned()));
    }
    let number = elements.len();
    elements.push(element);
    if let Some(&parent) = open.last() {
        elements[parent].children.push(number);
    }
    Ok(number)
}

fn append(elements: &mut [Element], open: &[usize], content: &[u8]) {
    if let Some(&number) = open.last()
        && !content.iter().all(u8::is_ascii_whitespace)
    {
        elements[number].text.push_str(&String::from_utf8_lossy(content));
    }
}

/// Line of a byte, for messages.
fn place(text: &str, offset: usize) -> String {
    let before = &text.as_bytes()[..offset.min(text.len())];
    format!("line {}", before.iter().filter(|&&b| b == b'\n').count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        parse(Path::new("a.xdmf"), text).unwrap_err().to_string()
    }

    #[test]
    fn a_tree_keeps_names_attributes_and_text() {
        let text = "<?xml version=\"1.0\"?><!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf><xi:include a='x &lt; y'/><A>1 <B/>2</A></Xdmf>";
        let document = parse(Path::new("a.xdmf"), text).unwrap();
        let names: Vec<_> = document.elements.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["Xdmf", "include", "A", "B"]);
        assert_eq!(document.elements[1].attribute("a"), Some("x < y"));
        assert_eq!(document.elements[2].text, "1 2");
    }

    #[test]
    fn entity_bombs_are_refused_before_anything_is_expanded() {
        let bomb = "<!DOCTYPE x [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><Xdmf>&b;</Xdmf>";
        assert!(refusal(bomb).contains("line 1: found a document type with declarations, expected none"));
        assert!(refusal("<Xdmf>\n&b;</Xdmf>").contains("line 2: found the entity \"b\", expected text without entities; write the text"));
        assert!(refusal("<Xdmf a='&b;'/>").contains("expected values without entities"));
    }

    #[test]
    fn depth_elements_and_attributes_are_bounded() {
        assert!(refusal(&"<a>".repeat(1_000_000)).contains("elements more than 32 deep"));
        assert!(refusal(&format!("<a>{}", "<b/>".repeat(300_000))).contains("more than 200000 elements"));
        assert!(refusal(&format!("<a {}/>", "b='' ".repeat(1_000_000))).contains("more than 32 attributes"));
    }

    #[test]
    fn broken_text_is_refused_with_its_line() {
        assert!(refusal("").contains("found no element, expected an Xdmf element"));
        assert!(refusal("<Xdmf>\n<A></B>").contains("line 2: found "));
        assert!(refusal("<Xdmf><A>").contains("the end of the file inside \"A\""));
        assert!(refusal("<Xdmf/><Xdmf/>").contains("a second root element"));
    }
}
