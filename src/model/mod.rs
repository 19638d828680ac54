//! What a system is: bodies, hinges and the modal data they carry.
pub mod modal_body;
