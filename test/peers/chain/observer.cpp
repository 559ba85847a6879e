// Times of a chain's input and output over Cyclone DDS: for each cloud on `points`, how long after it the first message
// came that has its stamp or a later one. Markers have no stamp: the first array after the cloud counts, so that clouds
// have to come one by one.
//
//   observer --domain N --topic NAME --type cloud|update|markers --clouds COUNT
//
// Prints `ready`, and a line of JSON after the output of the last cloud or at SIGTERM. Samples are not decoded: their
// stamp is read from the first bytes.
#include <dds/ddsi/ddsi_serdata.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "dds.hpp"
#include "ros.h"

struct Seen {
  int64_t stamp_ns;
  double at_s;
};

struct Input {
  dds_entity_t reader;
  size_t stamp_at;  // of the stamp behind the four bytes of the encapsulation
  uint64_t bytes = 0, messages = 0;
  std::vector<Seen> seen;

  void take() {
    ddsi_serdata* samples[16];
    dds_sample_info_t infos[16];
    for (int n; (n = dds_takecdr(reader, samples, 16, infos, DDS_ANY_STATE)) > 0;) {
      const double at_s = chain::now_s();
      for (int i = 0; i < n; ++i) {
        const uint32_t size = ddsi_serdata_size(samples[i]);
        if (infos[i].valid_data && size >= stamp_at + 8) {
          int32_t sec;
          uint32_t nanosec;
          char start[16];
          ddsi_serdata_to_ser(samples[i], 0, sizeof start, start);
          std::memcpy(&sec, start + stamp_at, 4);
          std::memcpy(&nanosec, start + stamp_at + 4, 4);
          seen.push_back({int64_t{sec} * 1'000'000'000 + nanosec, at_s});
          bytes += size;
          ++messages;
        }
        ddsi_serdata_unref(samples[i]);
      }
    }
  }
};

double at_share(std::vector<double>& sorted, double share) {
  return sorted.empty() ? -1.0 : sorted[std::min(sorted.size() - 1, static_cast<size_t>(share * static_cast<double>(sorted.size())))];
}

int main(int argc, char** argv) {
  auto given = chain::arguments(argc, argv);
  chain::end_with_sigterm();
  const std::string type = given["--type"];
  const dds_topic_descriptor_t* descriptor = type == "cloud"    ? &sensor_msgs_msg_dds__PointCloud2__desc
                                             : type == "update" ? &lattice_msgs_msg_dds__LatticeMapUpdate__desc
                                                                : &visualization_msgs_msg_dds__MarkerArray__desc;
  const dds_entity_t participant = chain::checked(
      dds_create_participant(static_cast<dds_domainid_t>(std::stoul(given["--domain"])), nullptr, nullptr), "participant");
  Input in{chain::reader(participant, &sensor_msgs_msg_dds__PointCloud2__desc, "points", 100), 4, 0, 0, {}};
  // An array begins with its length.
  Input out{chain::reader(participant, descriptor, given["--topic"], 1000), type == "markers" ? size_t{8} : size_t{4}, 0, 0, {}};
  const dds_entity_t waits = chain::checked(dds_create_waitset(participant), "waitset");
  for (const Input* input : {&in, &out}) {
    dds_set_status_mask(input->reader, DDS_DATA_AVAILABLE_STATUS);
    dds_waitset_attach(waits, input->reader, 0);
  }
  std::printf("ready\n");
  std::fflush(stdout);
  const size_t clouds = std::stoul(given["--clouds"]);
  const auto shows = [&type](const Seen& shown, const Seen& cloud) {
    return type == "markers" ? shown.at_s > cloud.at_s : shown.stamp_ns >= cloud.stamp_ns;
  };
  bool complete = false;
  while (!chain::ended && !complete) {
    dds_attach_t triggered[2];
    dds_waitset_wait(waits, triggered, 2, DDS_MSECS(100));
    in.take();
    out.take();
    complete = in.messages >= clouds && !out.seen.empty() && shows(out.seen.back(), in.seen.back());
  }
  std::vector<double> waited;
  for (const Seen& cloud : in.seen) {
    for (const Seen& shown : out.seen) {
      if (!shows(shown, cloud)) continue;
      waited.push_back(1e3 * (shown.at_s - cloud.at_s));
      break;
    }
  }
  std::sort(waited.begin(), waited.end());
  std::printf(
      "{\"clouds\":%llu,\"shown\":%zu,\"median_ms\":%.3f,\"p95_ms\":%.3f,\"messages\":%llu,\"bytes\":%llu,\"complete\":%s}\n",
      static_cast<unsigned long long>(in.messages), waited.size(), at_share(waited, 0.5), at_share(waited, 0.95),
      static_cast<unsigned long long>(out.messages), static_cast<unsigned long long>(out.bytes), complete ? "true" : "false");
  dds_delete(participant);
}
