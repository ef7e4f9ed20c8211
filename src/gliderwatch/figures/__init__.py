"""Pictures: maps and plots, made on this machine, for pages, mails and reports."""
