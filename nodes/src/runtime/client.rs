//! stub
use super::{Node, RuntimeError};
/// x
pub struct TriggerClient;
impl TriggerClient {
    /// x
    pub fn call(&self) {}
}
impl Node {
    /// x
    pub fn trigger_client(&self, _name: &str) -> Result<TriggerClient, RuntimeError> {
        Ok(TriggerClient)
    }
}
