/* Parts of Cyclone DDS that are built. Types of its own, and finding them on the network, are not: every topic here is
   one of serialised bytes. */
#ifndef DDS_FEATURES_H
#define DDS_FEATURES_H

#define DDS_HAS_LIFESPAN 1
#define DDS_HAS_DEADLINE_MISSED 1
#define DDS_HAS_NETWORK_PARTITIONS 1
#define DDS_IS_STATIC_LIBRARY 1

#ifdef __linux__
#define DDS_HAS_SSM 1
#endif
#ifdef LATTICE_DDS_SECURITY
#define DDS_HAS_SECURITY 1
#endif

#endif
