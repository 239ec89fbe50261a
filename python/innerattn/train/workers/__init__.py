"""Several processes of one machine that train one learner: started, heard, and kept in step."""
