// What every peer needs: arguments, points in memory, clocks, memory, and the line of JSON.
#pragma once

#include <malloc.h>
#include <time.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace peer {

struct Point {
  float x, y, z;
};

struct Scan {
  double x, y, z;
  uint64_t points;
};

struct Arguments {
  std::string points, mode;
  double cell = 0.0;
  int threads = 1;
  size_t max_points = SIZE_MAX;
};

[[noreturn]] inline void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

inline Arguments parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    if (name == "--points") a.points = value;
    else if (name == "--mode") a.mode = value;
    else if (name == "--cell") a.cell = std::stod(value);
    else if (name == "--threads") a.threads = std::stoi(value);
    else if (name == "--max-points") a.max_points = std::stoull(value);
    else fail("unknown option " + name);
  }
  if (a.points.empty() || !(a.cell > 0.0)) fail("needs --points FILE --cell SIDE [--mode M] [--threads N] [--max-points N]");
  return a;
}

template <typename Record>
std::vector<Record> read_records(const std::string& path, size_t most) {
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (!file) fail(path + ": cannot be opened");
  std::fseek(file, 0, SEEK_END);
  const size_t there = static_cast<size_t>(std::ftell(file)) / sizeof(Record);
  std::rewind(file);
  std::vector<Record> records(there < most ? there : most);
  if (std::fread(records.data(), sizeof(Record), records.size(), file) != records.size()) fail(path + ": cannot be read");
  std::fclose(file);
  return records;
}

// Points shifted by half a cell, so that `floor` of the peers finds the cells of Lattice's cubic lattice,
// whose centres are at multiples of the side.
inline std::vector<Point> read_points(const Arguments& a) {
  struct Raw {
    float x, y, z, intensity;
  };
  const std::vector<Raw> raw = read_records<Raw>(a.points, a.max_points);
  const double half = 0.5 * a.cell;
  std::vector<Point> points;
  points.reserve(raw.size());
  for (const Raw& p : raw) {
    points.push_back({static_cast<float>(p.x + half), static_cast<float>(p.y + half), static_cast<float>(p.z + half)});
  }
  return points;
}

// The scans of the points, shifted like them; the last one is cut.
inline std::vector<Scan> read_scans(const Arguments& a, size_t points) {
  std::vector<Scan> scans = read_records<Scan>(a.points + ".scans", SIZE_MAX), kept;
  const double half = 0.5 * a.cell;
  for (Scan scan : scans) {
    if (scan.points > points) scan.points = points;
    points -= scan.points;
    if (scan.points > 0) kept.push_back({scan.x + half, scan.y + half, scan.z + half, scan.points});
  }
  if (points > 0) fail("the scans hold fewer points than the point file");
  return kept;
}

inline double seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Bytes that the heap has given out.
inline uint64_t heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

class Clock {
 public:
  Clock() : wall_(seconds(CLOCK_MONOTONIC)), cpu_(seconds(CLOCK_PROCESS_CPUTIME_ID)) {}
  void stop() {
    cpu_ = seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu_;
    wall_ = seconds(CLOCK_MONOTONIC) - wall_;
  }
  double wall() const { return wall_; }
  double cpu() const { return cpu_; }

 private:
  double wall_, cpu_;
};

inline void print(const std::string& sys, const Arguments& a, size_t n, const Clock& clock, uint64_t voxels, uint64_t bytes,
                  uint64_t count = 0) {
  std::printf(
      "{\"sys\":\"%s\",\"lattice\":\"cubic\",\"res\":%g,\"threads\":%d,\"n\":%zu,\"wall_s\":%.9f,\"cpu_s\":%.9f,"
      "\"voxels\":%llu,\"bytes\":%llu",
      sys.c_str(), a.cell, a.threads, n, clock.wall(), clock.cpu(), static_cast<unsigned long long>(voxels),
      static_cast<unsigned long long>(bytes));
  if (count > 0) std::printf(",\"count\":%llu", static_cast<unsigned long long>(count));
  std::printf("}\n");
}

}  // namespace peer
