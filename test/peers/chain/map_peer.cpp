// One process that makes a map of clouds and poses over Cyclone DDS, as a plain program with a peer's map would: takes
// `points` and `odom`, moves each cloud by the pose at its stamp, inserts it, and publishes the centres of all cells on
// `peer_centers` once a period.
//
//   map_peer --domain N --map octomap|octomap-rays|openvdb --cell SIDE --period SECONDS
//
// `octomap`: end points by updateNode with lazy evaluation; `octomap-rays`: insertPointCloud, lazy; `openvdb`: a grid of
// count and sum of coordinates, as the centroid grid of openvdb_peer.cpp. Prints a line of JSON at SIGTERM.
#include <octomap/octomap.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include "dds.hpp"
#include "ros.h"

using Odometry = nav_msgs_msg_dds__Odometry_;
using Cloud = sensor_msgs_msg_dds__PointCloud2_;
using CentroidTree = openvdb::tree::Tree4<openvdb::Vec4s, 5, 4, 3>::Type;

struct Pose {
  int64_t stamp_ns;
  double p[3], q[4];  // x, y, z; w, x, y, z
};

int64_t nanoseconds(const builtin_interfaces_msg_dds__Time_& t) { return int64_t{t.sec} * 1'000'000'000 + t.nanosec; }

// The pose at a stamp, between the poses about it: positions by line, attitudes by the normalised line of quaternions.
bool interpolate(const std::deque<Pose>& poses, int64_t stamp_ns, Pose& out) {
  for (size_t i = poses.size(); i-- > 1;) {
    const Pose &a = poses[i - 1], &b = poses[i];
    if (a.stamp_ns > stamp_ns || b.stamp_ns < stamp_ns) continue;
    const double t = b.stamp_ns == a.stamp_ns ? 0.0 : double(stamp_ns - a.stamp_ns) / double(b.stamp_ns - a.stamp_ns);
    double dot = 0.0, norm = 0.0;
    for (int k = 0; k < 4; ++k) dot += a.q[k] * b.q[k];
    for (int k = 0; k < 4; ++k) {
      out.q[k] = (1.0 - t) * a.q[k] + (dot < 0.0 ? -t : t) * b.q[k];
      norm += out.q[k] * out.q[k];
    }
    for (double& part : out.q) part /= std::sqrt(norm);
    for (int k = 0; k < 3; ++k) out.p[k] = (1.0 - t) * a.p[k] + t * b.p[k];
    return true;
  }
  return false;
}

struct Matrix {
  double r[3][3], t[3];
};

Matrix matrix(const Pose& pose) {
  const double w = pose.q[0], x = pose.q[1], y = pose.q[2], z = pose.q[3];
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
           {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
           {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}},
          {pose.p[0], pose.p[1], pose.p[2]}};
}

// A peer's map: cells by floor(coordinate / cell).
struct Map {
  virtual ~Map() = default;
  virtual void insert(const std::vector<octomap::point3d>& points, const octomap::point3d& origin) = 0;
  virtual void centers(std::vector<float>& out) const = 0;
};

struct Octomap : Map {
  octomap::OcTree tree;
  bool rays;
  octomap::Pointcloud cloud;
  Octomap(double cell, bool rays) : tree(cell), rays(rays) {}
  void insert(const std::vector<octomap::point3d>& points, const octomap::point3d& origin) override {
    if (!rays) {
      for (const octomap::point3d& p : points) tree.updateNode(p, true, true);
      return;
    }
    cloud.clear();
    for (const octomap::point3d& p : points) cloud.push_back(p);
    tree.insertPointCloud(cloud, origin, -1.0, true, false);
  }
  void centers(std::vector<float>& out) const override {
    for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
      if (!tree.isNodeOccupied(*leaf)) continue;
      out.push_back(static_cast<float>(leaf.getX()));
      out.push_back(static_cast<float>(leaf.getY()));
      out.push_back(static_cast<float>(leaf.getZ()));
    }
  }
};

struct Openvdb : Map {
  CentroidTree tree{openvdb::Vec4s(0.0f)};
  float cell;
  explicit Openvdb(double cell) : cell(static_cast<float>(cell)) {}
  void insert(const std::vector<octomap::point3d>& points, const octomap::point3d&) override {
    openvdb::tree::ValueAccessor<CentroidTree> accessor(tree);
    const float inverse = 1.0f / cell;
    for (const octomap::point3d& p : points) {
      const openvdb::Coord at(static_cast<int>(std::floor(p.x() * inverse)), static_cast<int>(std::floor(p.y() * inverse)),
                              static_cast<int>(std::floor(p.z() * inverse)));
      accessor.modifyValue(at, [&p](openvdb::Vec4s& sum) { sum += openvdb::Vec4s(p.x(), p.y(), p.z(), 1.0f); });
    }
  }
  void centers(std::vector<float>& out) const override {
    for (auto value = tree.cbeginValueOn(); value; ++value) {
      const openvdb::Vec4s& sum = *value;
      for (int k = 0; k < 3; ++k) out.push_back(sum[k] / sum[3]);
    }
  }
};

class Peer {
 public:
  Peer(dds_entity_t participant, std::unique_ptr<Map> map, double period_s)
      : map_(std::move(map)), period_s_(period_s),
        odom_(chain::reader(participant, &nav_msgs_msg_dds__Odometry__desc, "odom", 1000)),
        points_(chain::reader(participant, &sensor_msgs_msg_dds__PointCloud2__desc, "points", 100)),
        out_(chain::writer(participant, &sensor_msgs_msg_dds__PointCloud2__desc, "peer_centers", 1)),
        waits_(chain::checked(dds_create_waitset(participant), "waitset")) {
    for (const dds_entity_t reader : {odom_, points_}) {
      dds_set_status_mask(reader, DDS_DATA_AVAILABLE_STATUS);
      dds_waitset_attach(waits_, reader, reader);
    }
  }

  void run() {
    dds_attach_t triggered[2];
    while (!chain::ended) {
      dds_waitset_wait(waits_, triggered, 2, DDS_MSECS(100));
      take_poses();
      take_clouds();
      if (new_points_ && chain::now_s() >= due_s_) publish();
    }
    if (new_points_) publish();
    std::vector<float> centers;
    map_->centers(centers);
    std::printf("{\"clouds\":%zu,\"points\":%zu,\"voxels\":%zu}\n", clouds_, count_,
                centers.size() / 3);
  }

 private:
  void take_poses() {
    void* samples[64] = {};
    dds_sample_info_t infos[64];
    for (int n; (n = dds_take(odom_, samples, infos, 64, 64)) > 0; dds_return_loan(odom_, samples, n)) {
      for (int i = 0; i < n; ++i) {
        if (!infos[i].valid_data) continue;
        const Odometry& o = *static_cast<const Odometry*>(samples[i]);
        const auto& p = o.pose.pose.position;
        const auto& q = o.pose.pose.orientation;
        poses_.push_back({nanoseconds(o.header.stamp), {p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}});
        if (poses_.size() > 1000) poses_.pop_front();
      }
    }
  }

  void take_clouds() {
    void* samples[1] = {};
    dds_sample_info_t infos[1];
    // A cloud waits, unread, for the poses about its stamp.
    while (dds_read(points_, samples, infos, 1, 1) > 0) {
      bool done = true;
      if (infos[0].valid_data) done = insert(*static_cast<const Cloud*>(samples[0]));
      dds_return_loan(points_, samples, 1);
      if (!done) return;
      if (dds_take(points_, samples, infos, 1, 1) > 0) dds_return_loan(points_, samples, 1);
    }
  }

  // False if the cloud's pose is not known yet.
  bool insert(const Cloud& cloud) {
    Pose pose;
    if (!interpolate(poses_, nanoseconds(cloud.header.stamp), pose)) return false;
    uint32_t at[3] = {0, 0, 0};
    for (uint32_t i = 0; i < cloud.fields._length; ++i) {
      const char* name = cloud.fields._buffer[i].name;
      if (name[0] >= 'x' && name[0] <= 'z' && name[1] == 0) at[name[0] - 'x'] = cloud.fields._buffer[i].offset;
    }
    const Matrix m = matrix(pose);
    moved_.clear();
    for (size_t i = 0, n = size_t{cloud.width} * cloud.height; i < n; ++i) {
      const uint8_t* record = cloud.data._buffer + i * cloud.point_step;
      float p[3];
      for (int k = 0; k < 3; ++k) std::memcpy(&p[k], record + at[k], 4);
      if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
      double q[3];
      for (int k = 0; k < 3; ++k) q[k] = m.r[k][0] * p[0] + m.r[k][1] * p[1] + m.r[k][2] * p[2] + m.t[k];
      moved_.emplace_back(static_cast<float>(q[0]), static_cast<float>(q[1]), static_cast<float>(q[2]));
    }
    map_->insert(moved_, octomap::point3d(float(m.t[0]), float(m.t[1]), float(m.t[2])));
    stamp_ = cloud.header.stamp;
    new_points_ = true;
    ++clouds_;
    count_ += moved_.size();
    return true;
  }

  void publish() {
    centers_.clear();
    map_->centers(centers_);
    sensor_msgs_msg_dds__PointField_ fields[3] = {};
    char names[3][2] = {"x", "y", "z"};
    char frame[] = "map";
    for (uint32_t k = 0; k < 3; ++k) fields[k] = {names[k], 4 * k, 7, 1};
    Cloud cloud = {};
    cloud.header.stamp = stamp_;
    cloud.header.frame_id = frame;
    cloud.height = 1;
    cloud.width = static_cast<uint32_t>(centers_.size() / 3);
    cloud.fields = {3, 3, fields, false};
    cloud.point_step = 12;
    cloud.row_step = 12 * cloud.width;
    cloud.data._length = cloud.data._maximum = cloud.row_step;
    cloud.data._buffer = reinterpret_cast<uint8_t*>(centers_.data());
    cloud.is_dense = true;
    dds_write(out_, &cloud);
    new_points_ = false;
    due_s_ = chain::now_s() + period_s_;
  }

  std::unique_ptr<Map> map_;
  double period_s_, due_s_ = 0.0;
  dds_entity_t odom_, points_, out_, waits_;
  std::deque<Pose> poses_;
  std::vector<octomap::point3d> moved_;
  std::vector<float> centers_;
  builtin_interfaces_msg_dds__Time_ stamp_ = {};
  bool new_points_ = false;
  size_t clouds_ = 0, count_ = 0;
};

int main(int argc, char** argv) {
  auto given = chain::arguments(argc, argv);
  chain::end_with_sigterm();
  const double cell = std::stod(given["--cell"]);
  const std::string kind = given["--map"];
  std::unique_ptr<Map> map;
  if (kind == "openvdb") map = std::make_unique<Openvdb>(cell);
  else if (kind == "octomap" || kind == "octomap-rays") map = std::make_unique<Octomap>(cell, kind == "octomap-rays");
  else chain::fail("--map is octomap, octomap-rays or openvdb");
  const dds_entity_t participant = chain::checked(
      dds_create_participant(static_cast<dds_domainid_t>(std::stoul(given["--domain"])), nullptr, nullptr), "participant");
  Peer(participant, std::move(map), std::stod(given["--period"])).run();
  dds_delete(participant);
}
