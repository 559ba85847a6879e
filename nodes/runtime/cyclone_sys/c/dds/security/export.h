/* Nothing is exported from a static library. */
#ifndef DDS_SECURITY_EXPORT_H
#define DDS_SECURITY_EXPORT_H

#define SECURITY_EXPORT
#define DDS_SECURITY_EXPORT

#endif
