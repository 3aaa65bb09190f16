#include "client/http/received_bytes.h"

#include <linux/tcp.h>  // <netinet/tcp.h> defines tcp_info without tcpi_bytes_received
#include <netinet/in.h>
#include <sys/socket.h>

namespace voxdag::client {

uint64_t received_bytes(int socket) {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  return info.tcpi_bytes_received;  // 0 from an old kernel, which writes fewer bytes
}

}  // namespace voxdag::client
