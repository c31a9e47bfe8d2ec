/* The rival: one topic of stage::AxisState on Cyclone DDS with the QoS of profile realtime. */
#pragma once
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
typedef void (*cyclone_receive)(int64_t sent_ns, void* context);
/* Both return 0 when all went well. */
int cyclone_open_writer(uint32_t domain);
int cyclone_open_reader(uint32_t domain, cyclone_receive receive, void* context);
void cyclone_write(int64_t sent_ns);
#ifdef __cplusplus
}
#endif
