"""Notices to the owner: texts, outbox, dispatch, receipts."""
