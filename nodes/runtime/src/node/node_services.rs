//! Services and clients of a node.

use lattice_msgs::RosService;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};

use super::logical_node::Node;
use super::shared::Client;
use crate::communication::service::{Reply, Server};
use crate::config::names::NameKind;
use crate::error::RuntimeError;

impl Node {
    /// Serves `S`; the handler runs on the io thread and must return at once.
    ///
    /// ```no_run
    /// use lattice_msgs::std_srvs::{SetBool, SetBoolResponse};
    /// # fn serve(node: &lattice_runtime::Node) -> Result<(), lattice_runtime::RuntimeError> {
    /// let server = node.service::<SetBool>("~/set_on", |request| SetBoolResponse {
    ///     success: true,
    ///     message: format!("set to {}", request.data),
    /// })?;
    /// println!("serving {}", server.name());
    /// # Ok(())
    /// # }
    /// ```
    pub fn service<S: RosService + 'static>(
        &self,
        name: &str,
        mut handler: impl FnMut(S::Request) -> S::Response + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        self.service_later::<S>(name, move |request, reply| reply.send(handler(request)))
    }

    /// Serves `S` with deferred replies: the handler runs on the io thread and must return at once, the reply
    /// may be sent later. The next request waits until then.
    pub fn service_later<S: RosService + 'static>(
        &self,
        name: &str,
        handler: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        self.service_concurrent::<S>(name, 1, handler)
    }

    /// Serves `S` with up to `max_pending` deferred replies; further
    /// requests wait.
    pub fn service_concurrent<S: RosService + 'static>(
        &self,
        name: &str,
        max_pending: usize,
        handler: impl FnMut(S::Request, Reply<S::Response>) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        let name = self.full_name(NameKind::Service, name)?;
        self.shared()
            .serve::<S>(self.id(), &name, max_pending, handler)
    }

    /// Creates a client of `S`. Its endpoints are created at its first call.
    pub fn client<S: RosService>(&self, name: &str) -> Result<Client, RuntimeError> {
        let name = self.full_name(NameKind::Service, name)?;
        Ok(self.shared().client::<S>(self.id(), name))
    }

    /// Serves `std_srvs/srv/Trigger`; the handler returns success and a message.
    pub fn service_trigger(
        &self,
        name: &str,
        mut handler: impl FnMut() -> (bool, String) + Send + 'static,
    ) -> Result<Server, RuntimeError> {
        self.service::<Trigger>(name, move |_: TriggerRequest| {
            let (success, message) = handler();
            TriggerResponse { success, message }
        })
    }
}
