//! The workbench: the loop of the program by hand, live, in the browser.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`session`] | what is open, one job at a time, its events |
//! | [`view`] | the session as JSON, curves as binary arrays |
//! | [`server`] | routes, who may come in, the files of the page |
//!
//! The session works through [`Study`](crate::Study) and the files of the commands; the page draws what the session
//! says. State lives here: a reload or a second tab shows the same, and after a kill the files are the truth.

pub mod server;
pub mod session;
pub mod view;
