"""The trainer side: learns the simulator from logs, finds what it lacks, and publishes the corrected one."""
