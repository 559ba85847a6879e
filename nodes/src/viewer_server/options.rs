//! Options of the viewer.

use std::io::Read;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use lattice_runtime::params::{ParamError, Params};

use super::host_addresses::reachable;
use super::http::RequestAuth;
use super::tls::{Identity, Tls, TlsError, state_folder};

/// Options of the viewer.
#[derive(Clone, Debug)]
pub struct ViewerOptions {
    /// Address and port to listen on.
    pub address: SocketAddr,
    /// Host names of this machine, besides `localhost` and addresses.
    pub allowed_hosts: Vec<String>,
    /// Allowed cross-origin pages.
    pub allowed_origins: Vec<String>,
    /// Required secret of clients; empty: none on loopback, else a random one.
    pub token: String,
    /// Encryption of the connections.
    pub tls: Tls,
    /// Limit of clients.
    pub max_clients: usize,
    /// Voxel limit of the followed map.
    pub max_voxels: usize,
    /// Period of map updates to clients, s.
    pub update_period_s: f64,
    /// Topics of displayed clouds.
    pub cloud_topics: Vec<String>,
}

impl Default for ViewerOptions {
    fn default() -> Self {
        Self {
            address: SocketAddr::from((Ipv4Addr::LOCALHOST, 8765)),
            allowed_hosts: Vec::new(),
            allowed_origins: Vec::new(),
            token: String::new(),
            tls: Tls::Off,
            max_clients: 16,
            max_voxels: 20_000_000,
            update_period_s: 0.1,
            cloud_topics: ["points_enu", "headset/points"].map(str::to_owned).into(),
        }
    }
}

impl ViewerOptions {
    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let address = params.string("address", &defaults.address.ip().to_string())?;
        let ip: IpAddr = address
            .parse()
            .map_err(|_| params.invalid("address", "expected an IP address, such as 0.0.0.0"))?;
        let port = params.usize_in("port", usize::from(defaults.address.port()), 0..=65_535)?;
        let token = params.string("token", "")?;
        let sound = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if !token.chars().all(sound) || token.len() > 128 {
            let expected = "expected at most 128 letters, digits, -, _ and .";
            return Err(params.invalid("token", expected));
        }
        let clouds: Vec<&str> = defaults.cloud_topics.iter().map(String::as_str).collect();
        let period_s = defaults.update_period_s;
        Ok(Self {
            address: SocketAddr::new(ip, port as u16),
            allowed_hosts: params.string_array("allowed_hosts", &[])?,
            allowed_origins: params.string_array("allowed_origins", &[])?,
            token,
            tls: tls(params)?,
            max_clients: params.usize_in("max_clients", defaults.max_clients, 1..=60)?,
            max_voxels: params.positive("max_voxels", defaults.max_voxels)?,
            update_period_s: params.f64_in("update_period_s", period_s, 0.02..=10.0)?,
            cloud_topics: params.string_array("cloud_topics", &clouds)?,
        })
    }

    /// Conditions for accepting requests. Without a token only loopback is served; elsewhere a missing token is generated.
    pub fn request_auth(&self) -> std::io::Result<RequestAuth> {
        let token = match (self.token.is_empty(), self.address.ip().is_loopback()) {
            (false, _) => Some(self.token.clone()),
            (true, true) => None,
            (true, false) => Some(random_token()?),
        };
        Ok(RequestAuth {
            hosts: self.allowed_hosts.clone(),
            origins: self.allowed_origins.clone(),
            token,
            secure: false,
        })
    }

    /// Certificate and key of the server, if it has TLS; a self-made one is kept in the user's folder for state.
    pub fn identity(&self) -> Result<Option<Identity>, TlsError> {
        self.tls
            .identity(state_folder, &reachable(self.address.ip()))
    }
}

/// Encryption by the parameters; the files are read at the start of the server.
fn tls(params: &Params) -> Result<Tls, ParamError> {
    let is_on = params.bool("tls", false)?;
    let [certificate, key] = [
        params.string("tls_certificate", "")?,
        params.string("tls_key", "")?,
    ];
    match (is_on, certificate.is_empty(), key.is_empty()) {
        (false, true, true) => Ok(Tls::Off),
        (true, true, true) => Ok(Tls::SelfMade),
        (true, false, false) => Ok(Tls::Files {
            certificate: certificate.into(),
            key: key.into(),
        }),
        (false, ..) => {
            let problem = "expected true where `tls_certificate` or `tls_key` is set";
            Err(params.invalid("tls", problem))
        }
        (true, false, true) => {
            let problem = "expected the path of the certificate's private key, since `tls_certificate` is set";
            Err(params.invalid("tls_key", problem))
        }
        (true, true, false) => {
            let problem = "expected the path of the key's certificate, since `tls_key` is set";
            Err(params.invalid("tls_certificate", problem))
        }
    }
}

/// Random token of 128 bits from the kernel.
fn random_token() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewer_server::Access;

    #[test]
    fn other_machines_need_a_token() {
        let mut options = ViewerOptions::default();
        let url = |options: &ViewerOptions, auth: &RequestAuth| {
            Access::new(options.address, auth, None).url
        };
        let auth = options.request_auth().unwrap();
        assert_eq!(auth.token, None);
        assert_eq!(url(&options, &auth), "http://127.0.0.1:8765");
        options.address.set_ip(Ipv4Addr::UNSPECIFIED.into());
        let [first, second] = [(), ()].map(|()| options.request_auth().unwrap());
        assert_eq!(first.token.as_ref().unwrap().len(), 32);
        assert_ne!(first.token, second.token);
        assert!(url(&options, &first).starts_with("http://127.0.0.1:8765/?token="));
        options.token = "mine".to_owned();
        assert_eq!(
            options.request_auth().unwrap().token.as_deref(),
            Some("mine")
        );
    }
}
