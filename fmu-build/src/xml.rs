//! Elements and attributes, indented, escaped; over quick-xml.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

/// Attributes of an element, in order. Those without a value are left out.
pub struct Attributes<'a>(Vec<(&'a str, String)>);

impl<'a> Attributes<'a> {
    /// No attribute yet.
    #[must_use]
    pub fn new() -> Self {
        Self(Vec::new())
    }

    /// Adds an attribute.
    #[must_use]
    pub fn with(mut self, name: &'a str, value: impl ToString) -> Self {
        self.0.push((name, value.to_string()));
        self
    }

    /// Adds an attribute if there is a value.
    #[must_use]
    pub fn with_some(self, name: &'a str, value: Option<impl ToString>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }
}

impl Default for Attributes<'_> {
    fn default() -> Self {
        Self::new()
    }
}

/// An XML document being written. Writing to memory does not fail.
pub struct Xml {
    writer: Writer<Vec<u8>>,
    open: Vec<&'static str>,
}

impl Xml {
    /// A document with the XML declaration.
    #[must_use]
    pub fn new() -> Self {
        let mut xml = Self::fragment();
        xml.event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)));
        xml
    }

    /// A document without the XML declaration, e.g. HTML.
    #[must_use]
    pub fn fragment() -> Self {
        Self { writer: Writer::new_with_indent(Vec::new(), b' ', 2), open: Vec::new() }
    }

    fn event(&mut self, event: Event<'_>) {
        self.writer.write_event(event).expect("writing to memory does not fail");
    }

    fn start<'a>(name: &'a str, attributes: &'a Attributes<'_>) -> BytesStart<'a> {
        BytesStart::new(name)
            .with_attributes(attributes.0.iter().map(|(name, value)| (*name, value.as_str())))
    }

    /// An element without content.
    pub fn empty(&mut self, name: &'static str, attributes: Attributes<'_>) {
        self.event(Event::Empty(Self::start(name, &attributes)));
    }

    /// Opens an element.
    pub fn open(&mut self, name: &'static str, attributes: Attributes<'_>) {
        self.event(Event::Start(Self::start(name, &attributes)));
        self.open.push(name);
    }

    /// Closes the element opened last.
    pub fn close(&mut self) {
        let name = self.open.pop().expect("an element is open");
        self.event(Event::End(BytesEnd::new(name)));
    }

    /// An element with text.
    pub fn text(&mut self, name: &'static str, text: &str) {
        self.text_with(name, Attributes::new(), text);
    }

    /// An element with attributes and text.
    pub fn text_with(&mut self, name: &'static str, attributes: Attributes<'_>, text: &str) {
        self.event(Event::Start(Self::start(name, &attributes)));
        self.event(Event::Text(BytesText::new(text)));
        self.event(Event::End(BytesEnd::new(name)));
    }

    /// The document.
    #[must_use]
    pub fn finish(self) -> String {
        assert!(self.open.is_empty(), "open: {:?}", self.open);
        let mut text = String::from_utf8(self.writer.into_inner()).expect("only strings were written");
        text.push('\n');
        text
    }
}

impl Default for Xml {
    fn default() -> Self {
        Self::new()
    }
}
