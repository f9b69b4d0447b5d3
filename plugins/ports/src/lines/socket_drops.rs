//! Counts datagrams that the kernel dropped because a socket's queue was full.
//!
//! A socket's queue fills while the program that reads it, or the whole computer, stalls. Linux has a count for each
//! socket in `/proc/net/udp`: the tenth column is the socket's inode, and the thirteenth column is the count. Other
//! systems have no count.

use std::fs;
use std::net::UdpSocket;
use std::os::fd::AsRawFd as _;
use std::os::unix::fs::MetadataExt as _;

/// The kernel's tables of UDP sockets for IPv4 and IPv6.
const TABLES: [&str; 2] = ["/proc/self/net/udp", "/proc/self/net/udp6"];
/// Indexes of the columns with inode and count.
const INODE: usize = 9;
const DROPS: usize = 12;

/// Counts the datagrams dropped at a socket since the previous query.
#[derive(Debug, Default)]
pub(super) struct SocketDrops {
    reported: u64,
}

impl SocketDrops {
    /// Returns the number of datagrams dropped at a socket since the previous call; 0 if the kernel doesn't report it.
    pub(super) fn new_ones(&mut self, socket: &UdpSocket) -> u64 {
        let all = dropped(socket).unwrap_or(self.reported);
        let new = all.saturating_sub(self.reported);
        self.reported = all;
        new
    }
}

fn dropped(socket: &UdpSocket) -> Option<u64> {
    let inode = fs::metadata(format!("/proc/self/fd/{}", socket.as_raw_fd())).ok()?.ino().to_string();
    TABLES.iter().find_map(|table| of_inode(&fs::read_to_string(table).ok()?, &inode))
}

/// Returns the drop count of the socket with this inode from the text of a table.
fn of_inode(table: &str, inode: &str) -> Option<u64> {
    table.lines().find_map(|line| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        (columns.get(INODE) == Some(&inode)).then(|| columns.get(DROPS)?.parse().ok()).flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropped_datagrams_are_reported_once() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut drops = SocketDrops::default();
        assert_eq!(drops.new_ones(&socket), 0);
        let to = socket.local_addr().unwrap();
        // This number of datagrams doesn't fit into the queue, whatever the kernel's default size is.
        let sent: u64 = 40_000;
        for _ in 0..sent {
            sender.send_to(&[7; 1000], to).unwrap();
        }
        let dropped = drops.new_ones(&socket);
        assert!(dropped > 0);
        assert_eq!(drops.new_ones(&socket), 0);
        socket.set_nonblocking(true).unwrap();
        let mut kept = 0;
        while socket.recv(&mut [0; 2000]).is_ok() {
            kept += 1;
        }
        assert_eq!(kept + dropped, sent);
    }

    #[test]
    fn drop_count_is_parsed_from_the_kernel_table() {
        let table = "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref pointer drops\n\
            \x20 311: 0100007F:1F90 00000000:0000 07 00000000:00034800 00:00000000 00000000     0        0 48213 2 0000000000000000 97\n";
        assert_eq!(of_inode(table, "48213"), Some(97));
        assert_eq!(of_inode(table, "4821"), None);
    }
}
