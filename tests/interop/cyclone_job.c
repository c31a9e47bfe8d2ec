/* A program of a plant on Cyclone DDS: orders a job of the cell `xy_table`, hears each reading of the laser on the profile
 * `calibration`, the job's progress, and which model the loop then uses. cyclone_job DOMAIN JOB */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "compensation.h"
#include "job.h"
#include "sensing.h"

static dds_entity_t topic(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name) {
  return dds_create_topic(participant, type, name, NULL, NULL);
}

static dds_entity_t reader(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name,
                           bool all) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, all ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST, 1);
  const dds_entity_t made = dds_create_reader(participant, topic(participant, type, name), qos, NULL);
  dds_delete_qos(qos);
  if (made < 0) fprintf(stderr, "%s: %s\n", name, dds_strretcode(-made));
  return made;
}

static dds_entity_t commander(dds_entity_t participant, const char* name) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_ownership(qos, DDS_OWNERSHIP_EXCLUSIVE);
  dds_qset_ownership_strength(qos, 20);
  dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
  dds_qset_lifespan(qos, DDS_SECS(1));
  const dds_entity_t made =
      dds_create_writer(participant, topic(participant, &invar_job_JobCommand_desc, name), qos, NULL);
  dds_delete_qos(qos);
  return made;
}

/* 1: a sample was taken, which the caller gives back. */
static int take(dds_entity_t from, void** sample) {
  dds_sample_info_t info;
  *sample = NULL;
  while (dds_take(from, sample, &info, 1, 1) > 0) {
    if (info.valid_data) return 1;
    dds_return_loan(from, sample, 1);
    *sample = NULL;
  }
  return 0;
}

static void order(dds_entity_t writer, const char* job) {
  invar_job_JobCommand command;
  memset(&command, 0, sizeof command);
  command.cell = 1;
  command.id = 4711;
  command.kind = invar_job_JOB_RUN;
  snprintf(command.name, sizeof command.name, "%s", job);
  dds_write(writer, &command);
}

int main(int count, char** words) {
  if (count != 3) return 2;
  const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(words[1]), NULL, NULL);
  const dds_entity_t readings =
      reader(participant, &invar_sensing_DisplacementReading_desc, "cell/xy_table/laser/reading", true);
  const dds_entity_t progress =
      reader(participant, &invar_job_JobStatus_desc, "cell/xy_table/calibration/status", false);
  const dds_entity_t models =
      reader(participant, &invar_compensation_ModelStatus_desc, "cell/xy_table/compensation/status", false);
  const dds_entity_t writer = commander(participant, "cell/xy_table/calibration/job");

  unsigned long read = 0;
  int phase = invar_job_JOB_IDLE, ordered = 0;
  for (int i = 0; i < 6000 && phase != invar_job_JOB_DONE && phase != invar_job_JOB_FAILED; ++i) {
    void* sample;
    for (; take(readings, &sample) == 1; dds_return_loan(readings, &sample, 1)) ++read;
    for (; take(models, &sample) == 1; dds_return_loan(models, &sample, 1)) {
      const invar_compensation_ModelStatus* model = sample;
      printf("model %d %u\n", (int)model->state, model->geometric_checksum);
    }
    for (; take(progress, &sample) == 1; dds_return_loan(progress, &sample, 1)) {
      const invar_job_JobStatus* status = sample;
      if (status->id != 4711) continue;
      phase = (int)status->phase;
      printf("job %d %.2f %s\n", phase, status->progress, status->text);
    }
    dds_publication_matched_status_t matched;
    dds_get_publication_matched_status(writer, &matched);
    if (!ordered && matched.current_count > 0) order(writer, words[2]), ordered = 1;
    dds_sleepfor(DDS_MSECS(20));
  }
  printf("end %d after %lu readings\n", phase, read);
  dds_delete(participant);
  return phase == invar_job_JOB_DONE ? 0 : 1;
}
