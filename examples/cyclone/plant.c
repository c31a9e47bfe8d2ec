/* A plant's program on Cyclone DDS: reads a temperature of a cell and gives it another setpoint.
 * plant DOMAIN TOPIC SETPOINT, where TOPIC is cell/<cell>/<component> of a component of type `thermal`. */
#include <dds/dds.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "thermal.h"

/* The profiles `state` and `command` of the cell (invar profiles). */
static dds_qos_t* state_profile(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  return qos;
}

static dds_qos_t* command_profile(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 200);
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_ownership(qos, DDS_OWNERSHIP_EXCLUSIVE);
  dds_qset_ownership_strength(qos, 20); /* above the 10 of the cell's own writers */
  dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
  dds_qset_lifespan(qos, DDS_SECS(1));
  return qos;
}

static dds_entity_t topic(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* component,
                          const char* port) {
  char name[256];
  snprintf(name, sizeof name, "%s/%s", component, port);
  return dds_create_topic(participant, type, name, NULL, NULL);
}

/* Waits up to ten seconds for a reader on the other side: a command to nobody is lost. */
static int matched(dds_entity_t writer) {
  for (int i = 0; i < 1000; ++i) {
    dds_publication_matched_status_t status;
    if (dds_get_publication_matched_status(writer, &status) == 0 && status.current_count > 0) return 1;
    dds_sleepfor(DDS_MSECS(10));
  }
  return 0;
}

int main(int count, char** words) {
  if (count != 4) {
    fprintf(stderr, "plant DOMAIN TOPIC SETPOINT, for example: plant 71 cell/xy_table/thermal 32\n");
    return 2;
  }
  const double wanted = atof(words[3]);
  const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(words[1]), NULL, NULL);
  dds_qos_t* of_state = state_profile();
  const dds_entity_t reader = dds_create_reader(
      participant, topic(participant, &invar_thermal_NodeTemperature_desc, words[2], "state"), of_state,
      NULL);
  dds_delete_qos(of_state);
  dds_qos_t* of_command = command_profile();
  const dds_entity_t writer = dds_create_writer(
      participant, topic(participant, &invar_thermal_ThermalCommand_desc, words[2], "command"), of_command,
      NULL);
  dds_delete_qos(of_command);
  if (reader < 0 || writer < 0 || !matched(writer)) {
    fprintf(stderr, "nobody reads %s/command in domain %s\n", words[2], words[1]);
    return 1;
  }
  int sent = 0;
  for (int i = 0; i < 1000; ++i) { /* ten seconds */
    void* sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(reader, sample, &info, 1, 1) > 0) {
      const invar_thermal_NodeTemperature* now = sample[0];
      if (info.valid_data && !sent) {
        printf("%.0f degC wanted so far\n", now->setpoint);
        invar_thermal_ThermalCommand order;
        memset(&order, 0, sizeof order);
        order.cell = now->cell; /* the keys are those of the state */
        order.node = now->node;
        order.id = 1;
        order.setpoint = wanted;
        order.enabled = true;
        if (dds_write(writer, &order) != 0) return 1;
        sent = 1;
      } else if (info.valid_data && fabs(now->setpoint - wanted) < 1e-9) {
        printf("%.0f degC wanted now\n", now->setpoint);
        dds_delete(participant);
        return 0;
      }
      dds_return_loan(reader, sample, 1);
    }
    dds_sleepfor(DDS_MSECS(10));
  }
  fprintf(stderr, "the cell did not take the setpoint; its log says why\n");
  return 1;
}
